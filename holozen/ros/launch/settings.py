"""Actions that set something for what comes after them: arguments and environment."""

from typing import Any

from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action
from holozen.ros.launch.text import LaunchError, Text, shown, text, truth


class DeclareLaunchArgument(Action):
    """An argument of the launch file, given as name:=value, by who includes the file, or by its default."""

    def __init__(
        self, name: str, *, default_value: Any = None, description: str = "", choices: Any = None, **others: Any
    ) -> None:
        super().__init__(**others)
        self.name, self.default_value, self.description = name, default_value, description
        self.choices = list(choices) if choices else []

    def execute(self, context: LaunchContext) -> None:
        """Give it its value. Raises LaunchError if there is none, or a wrong one."""
        values = context.launch_configurations
        context.used.add(self.name)
        if self.name not in values:
            if self.default_value is None:
                raise LaunchError(f"launch argument {self.name!r} has no value; give {self.name}:=VALUE", self.place)
            values[self.name] = text(context, self.default_value)
        if self.choices and values[self.name] not in self.choices:
            told = f"{self.name}:={values[self.name]}: it has to be one of {', '.join(self.choices)}"
            raise LaunchError(told, self.place)

    def told(self) -> str:
        """The argument in one line."""
        default = f"default: {shown(self.default_value)}" if self.default_value is not None else "it has to be given"
        choices = f"; one of {', '.join(self.choices)}" if self.choices else ""
        return " ".join([f"{self.name}:=", *self.description.split(), f"({default}{choices})"])


class SetLaunchConfiguration(Action):
    """Gives an argument another value."""

    def __init__(self, name: Text, value: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name, self.value = name, value

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.launch_configurations[text(context, self.name)] = text(context, self.value)


class UnsetLaunchConfiguration(Action):
    """Takes an argument's value away."""

    def __init__(self, name: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name = name

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.launch_configurations.pop(text(context, self.name), None)


class SetEnvironmentVariable(Action):
    """Sets a variable for the processes to come."""

    def __init__(self, name: Text, value: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name, self.value = name, value

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.environment[text(context, self.name)] = text(context, self.value)


class AppendEnvironmentVariable(SetEnvironmentVariable):
    """Adds to a variable for the processes to come."""

    def __init__(self, name: Text, value: Text, prepend: Any = False, separator: str = ":", **others: Any) -> None:
        super().__init__(name, value, **others)
        self.prepend, self.separator = prepend, separator

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        name = text(context, self.name)
        parts = [context.environment.get(name, ""), text(context, self.value)]
        parts = parts[::-1] if truth(context, self.prepend, "prepend") else parts
        context.environment[name] = self.separator.join(filter(None, parts))


class UnsetEnvironmentVariable(Action):
    """Takes a variable away from the processes to come."""

    def __init__(self, name: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name = name

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.environment.pop(text(context, self.name), None)
