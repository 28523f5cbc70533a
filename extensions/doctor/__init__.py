"""What is wrong on this machine and among the nodes, and what to do about it."""
