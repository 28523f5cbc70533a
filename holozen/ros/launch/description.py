"""launch: the description that a launch file returns."""

from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action, Condition, LaunchDescription, LaunchDescriptionEntity
from holozen.ros.launch.sources import PythonLaunchDescriptionSource as LaunchDescriptionSource
from holozen.ros.launch.text import Substitution
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
]
