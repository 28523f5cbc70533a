"""launch.conditions: when an action is executed."""

from typing import Any

from holozen.ros.launch.launch_context import LaunchContext, LaunchError, Text, here, text, truth
from holozen.ros.launch.launch_description import Condition

__all__ = [
    "IfCondition",
    "LaunchConfigurationEquals",
    "LaunchConfigurationNotEquals",
    "UnlessCondition",
]


class IfCondition(Condition):
    """Holds if a text is true."""

    def __init__(self, predicate_expression: Text) -> None:
        self.predicate, self.place = predicate_expression, here()

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it does. Raises LaunchError if the text is neither true nor false."""
        try:
            return truth(context, self.predicate, "the condition")
        except LaunchError as error:
            raise LaunchError.of(error, self.place) from None


class UnlessCondition(IfCondition):
    """Holds if a text is false."""

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it does. Raises LaunchError if the text is neither true nor false."""
        return not super().evaluate(context)


class LaunchConfigurationEquals(Condition):
    """Holds if a launch argument has a certain value."""

    def __init__(self, launch_configuration_name: str, expected_value: Any) -> None:
        self.name, self.expected = launch_configuration_name, expected_value

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it does."""
        context.used.add(self.name)
        expected = None if self.expected is None else text(context, self.expected)
        return context.launch_configurations.get(self.name) == expected


class LaunchConfigurationNotEquals(LaunchConfigurationEquals):
    """Holds if a launch argument has any other value."""

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it does."""
        return not super().evaluate(context)
