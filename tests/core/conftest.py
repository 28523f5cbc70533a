"""How hypothesis runs in the unit tests."""

import os

from hypothesis import settings

# A slow machine is no failure, so no deadline. The examples are the same in each run, so that a
# failure is due to what has changed; `scripts/test --long` looks for new ones.
settings.register_profile("unit", deadline=None, max_examples=40, derandomize=True)
settings.register_profile("long", deadline=None, max_examples=1000)
settings.load_profile("long" if os.environ.get("HOLOZEN_LONG") == "1" else "unit")
