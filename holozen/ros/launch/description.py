"""launch: the description that a launch file returns."""

from typing import Any

from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action, Condition, LaunchDescription, LaunchDescriptionEntity
from holozen.ros.launch.sources import PythonLaunchDescriptionSource as LaunchDescriptionSource
from holozen.ros.launch.text import Substitution, text
from holozen.ros.launch.text import Text as SomeSubstitutionsType

__all__ = [
    "Action",
    "Condition",
    "LaunchContext",
    "LaunchDescription",
    "LaunchDescriptionEntity",
    "LaunchDescriptionSource",
    "SomeSubstitutionsType",
    "Substitution",
    "perform_substitutions",
]


def perform_substitutions(context: LaunchContext, subs: Any) -> str:
    """The text of several substitutions after each other. Raises LaunchError."""
    return text(context, subs)
