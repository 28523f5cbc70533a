"""What tests of extensions share with others: how hypothesis runs, and those of `wire/` the
fixtures of integration.
"""

import tests.core.conftest  # noqa: F401 - how hypothesis runs
from tests.integration.conftest import foreign, only_robot, robot, sim, town, verb

__all__ = ["foreign", "only_robot", "robot", "sim", "town", "verb"]
