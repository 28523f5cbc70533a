"""Drive and simulate holonomic robots over Zenoh, with the topics and services of ROS."""

import os

_TREE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# a checkout: there, the wheel's holozen/view is extensions/view
if os.path.exists(f"{_TREE}/pyproject.toml"):
    __path__.append(f"{_TREE}/extensions")
