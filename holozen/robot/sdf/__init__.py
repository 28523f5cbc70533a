"""SDF models and worlds -> robots, bodies and what the world is like."""
