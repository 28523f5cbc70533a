"""Real processes on loopback Zenoh, real physics, real pseudo-terminals."""
