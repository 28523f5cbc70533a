"""Fixtures that start real services and wait for conditions, as a pytest plugin."""
