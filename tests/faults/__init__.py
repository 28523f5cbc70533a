"""Faults of networks and clocks, made on purpose."""
