"""What may be wrong with this machine, its software and the robots that run; each finding with its mend."""
