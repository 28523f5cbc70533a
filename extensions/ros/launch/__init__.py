"""launch: what a launch file consists of."""

from typing import Any

from holozen.ros.launch.launch_context import LaunchContext, Substitution, text
from holozen.ros.launch.launch_context import Text as SomeSubstitutionsType
from holozen.ros.launch.launch_description import (
    Action,
    Condition,
    LaunchDescription,
    LaunchDescriptionEntity,
)
from holozen.ros.launch.launch_description_sources import (
    PythonLaunchDescriptionSource as LaunchDescriptionSource,
)
from holozen.ros.launch.launch_service import LaunchService
from holozen.ros.launch.stand_ins import replace_gazebo_packages

__all__ = [
    "Action",
    "Condition",
    "LaunchContext",
    "LaunchDescription",
    "LaunchDescriptionEntity",
    "LaunchDescriptionSource",
    "LaunchService",
    "SomeSubstitutionsType",
    "Substitution",
    "perform_substitutions",
]

for_scripts = replace_gazebo_packages


def perform_substitutions(context: LaunchContext, subs: Any) -> str:
    """The concatenated texts of several substitutions. Raises LaunchError."""
    return text(context, subs)
