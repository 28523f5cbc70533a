"""How hypothesis runs in the unit tests."""

from hypothesis import settings

# A slow machine is no failure, so no deadline.
settings.register_profile("unit", deadline=None, max_examples=100)
settings.load_profile("unit")
