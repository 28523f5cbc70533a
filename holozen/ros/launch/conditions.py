"""launch.conditions: when an action is done."""

from typing import Any

from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Condition
from holozen.ros.launch.text import Text, here, text, truth

__all__ = [
    "IfCondition",
    "LaunchConfigurationEquals",
    "LaunchConfigurationNotEquals",
    "UnlessCondition",
]


class IfCondition(Condition):
    """Holds if a text says true."""

    def __init__(self, predicate_expression: Text) -> None:
        self.predicate, self.place = predicate_expression, here()

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it does. Raises LaunchError for what is neither true nor false."""
        return truth(context, self.predicate, f"{self.place}: the condition")


class UnlessCondition(IfCondition):
    """Holds if a text says false."""

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it does. Raises LaunchError for what is neither true nor false."""
        return not super().evaluate(context)


class LaunchConfigurationEquals(Condition):
    """Holds if a launch argument has a value."""

    def __init__(self, launch_configuration_name: str, expected_value: Any) -> None:
        self.name, self.expected = launch_configuration_name, expected_value

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it has."""
        context.used.add(self.name)
        expected = None if self.expected is None else text(context, self.expected)
        return context.launch_configurations.get(self.name) == expected


class LaunchConfigurationNotEquals(LaunchConfigurationEquals):
    """Holds if a launch argument has another value."""

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it has."""
        return not super().evaluate(context)
