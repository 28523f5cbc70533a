"""launch.substitutions and launch_ros.substitutions: texts that are known only when the launch file runs."""

import math
import os
import shutil
from pathlib import Path
from typing import Any

from holozen.flags import nearest
from holozen.robot.errors import RobotError
from holozen.ros.launch.commands import OURS, output
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.folders import ExecutableInPackage, FindPackage, FindPackagePrefix, FindPackageShare
from holozen.ros.launch.logic import (
    AndSubstitution,
    EqualsSubstitution,
    IfElseSubstitution,
    NotEqualsSubstitution,
    NotSubstitution,
    OrSubstitution,
)
from holozen.ros.launch.text import LaunchError, Substitution, Text, here, shown, text

__all__ = [
    "AndSubstitution",
    "AnonName",
    "Command",
    "EnvironmentVariable",
    "EqualsSubstitution",
    "ExecutableInPackage",
    "FileContent",
    "FindExecutable",
    "FindPackage",
    "FindPackagePrefix",
    "FindPackageShare",
    "IfElseSubstitution",
    "LaunchConfiguration",
    "NotEqualsSubstitution",
    "NotSubstitution",
    "OrSubstitution",
    "PathJoinSubstitution",
    "PythonExpression",
    "TextSubstitution",
    "ThisLaunchFile",
    "ThisLaunchFileDir",
]


class TextSubstitution(Substitution):
    """A text as it is."""

    def __init__(self, *, text: str) -> None:
        self.text = text

    def perform(self, context: LaunchContext) -> str:
        """The text."""
        return self.text


class LaunchConfiguration(Substitution):
    """The value of a launch argument; `default` if it has none."""

    def __init__(self, variable_name: Text, *, default: Any = None) -> None:
        self.variable_name, self.default, self.place = variable_name, default, here()

    def perform(self, context: LaunchContext) -> str:
        """The value. Raises LaunchError if there is none."""
        name, values = text(context, self.variable_name), context.launch_configurations
        context.used.add(name)
        if name in values:
            return values[name]
        if self.default is None:
            hint = nearest(name, values) or f"; there are {', '.join(values) or 'none'}"
            raise LaunchError(f"launch argument {name!r} is not declared before it is used{hint}", self.place)
        return str(self.default) if isinstance(self.default, bool | int | float) else text(context, self.default)

    def describe(self) -> str:
        """Its name."""
        return shown(self.variable_name)


class PathJoinSubstitution(Substitution):
    """Parts of a path, joined."""

    def __init__(self, substitutions: Any) -> None:
        self.substitutions = list(substitutions)

    def perform(self, context: LaunchContext) -> str:
        """The path."""
        return os.path.join(*(text(context, part) for part in self.substitutions))

    def describe(self) -> str:
        """Its parts."""
        return "/".join(map(shown, self.substitutions))


class Command(Substitution):
    """What `xacro FILE name:=value ...` writes. Nothing but xacro and cat is run."""

    def __init__(self, command: Text, *, on_stderr: str = "fail") -> None:
        self.command, self.place = command, here()

    def perform(self, context: LaunchContext) -> str:
        """The text. Raises LaunchError."""
        try:
            return output(context, text(context, self.command))
        except RobotError as error:
            raise LaunchError(str(error), self.place) from None
        except LaunchError as error:
            raise error.at(self.place) from None


class FindExecutable(Substitution):
    """The path of a program."""

    def __init__(self, *, name: Text) -> None:
        self.name, self.place = name, here()

    def perform(self, context: LaunchContext) -> str:
        """The path; the name alone of what we stand in for. Raises LaunchError."""
        name = text(context, self.name)
        if name in OURS:
            return name
        found = shutil.which(name)
        if found is None:
            raise LaunchError(f"no program {name!r} on the PATH", self.place)
        return found


class EnvironmentVariable(Substitution):
    """The value of an environment variable."""

    def __init__(self, name: Text, *, default_value: Any = None) -> None:
        self.name, self.default, self.place = name, default_value, here()

    def perform(self, context: LaunchContext) -> str:
        """The value, or the default. Raises LaunchError if there is neither."""
        name = text(context, self.name)
        if name in context.environment:
            return context.environment[name]
        if self.default is None:
            raise LaunchError(f"the environment has no {name!r}; set it, or give default_value", self.place)
        return text(context, self.default)


class PythonExpression(Substitution):
    """What a Python expression gives, with the names of math; `python_modules` names others."""

    def __init__(self, expression: Text, python_modules: Any = ()) -> None:
        self.expression, self.modules, self.place = expression, list(python_modules), here()

    def perform(self, context: LaunchContext) -> str:
        """The value as text. Raises LaunchError."""
        source = text(context, self.expression)
        try:
            names = {"math": math, **vars(math)}
            names |= {name: __import__(name) for name in (text(context, module) for module in self.modules)}
            return str(eval(source, names))
        except Exception as error:
            told = f"PythonExpression {source!r}: {type(error).__name__}: {error}"
            raise LaunchError(told, self.place) from None


class ThisLaunchFile(Substitution):
    """The path of the launch file."""

    def perform(self, context: LaunchContext) -> str:
        """The path."""
        return str(context.file)


class ThisLaunchFileDir(Substitution):
    """The folder of the launch file."""

    def perform(self, context: LaunchContext) -> str:
        """The folder."""
        return str(context.file.parent)


class FileContent(Substitution):
    """What is in a file."""

    def __init__(self, path: Text) -> None:
        self.path, self.place = path, here()

    def perform(self, context: LaunchContext) -> str:
        """The text. Raises LaunchError."""
        path = text(context, self.path)
        try:
            return Path(path).read_text()
        except (OSError, UnicodeDecodeError) as error:
            told = getattr(error, "strerror", "") or "it is no text"
            raise LaunchError(f"cannot read {path}: {told}", self.place) from None


class AnonName(Substitution):
    """A name that no other process has."""

    def __init__(self, name: Text) -> None:
        self.name = name

    def perform(self, context: LaunchContext) -> str:
        """The name with this process's number."""
        return f"{text(context, self.name)}_{os.getpid()}"
