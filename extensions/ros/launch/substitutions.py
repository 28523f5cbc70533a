"""launch.substitutions and launch_ros.substitutions: texts that are evaluated when the launch file
is executed.
"""

import math
import os
import shlex
import shutil
from pathlib import Path
from typing import Any

from holozen.ros import descriptions, executables, packages
from holozen.ros.launch.launch_context import (
    LaunchContext,
    LaunchError,
    Substitution,
    Text,
    describe,
    text,
    truth,
)
from holozen.suggest import suggest

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

REPLACED = ("xacro", "ros2", "gazebo", "gzserver", "gzclient", "gz", "ign", "rviz2")
"""Programs that ROS's launch files name, and that are replaced here and never run."""

_IGNORED = ("--inorder", "-i")  # flags of xacro for what it does anyway


class TextSubstitution(Substitution):
    """A constant text."""

    def __init__(self, *, text: str) -> None:
        self.text = text

    def _text(self, context: LaunchContext) -> str:
        return self.text


class LaunchConfiguration(Substitution):
    """The value of a launch argument, or `default` if it has none."""

    def __init__(self, variable_name: Text, *, default: Any = None) -> None:
        self.variable_name, self.default = variable_name, default

    def _text(self, context: LaunchContext) -> str:
        name, values = text(context, self.variable_name), context.launch_configurations
        context.used.add(name)
        if name in values:
            return values[name]
        if self.default is None:
            hint = suggest(name, values) or f"; declared arguments: {', '.join(values) or 'none'}"
            raise LaunchError(f"launch argument {name!r} is not declared before it is used{hint}")
        return (
            str(self.default)
            if isinstance(self.default, bool | int | float)
            else text(context, self.default)
        )

    def describe(self) -> str:
        """Its name."""
        return describe(self.variable_name)


class PathJoinSubstitution(Substitution):
    """The joined parts of a path."""

    def __init__(self, substitutions: Any) -> None:
        self.substitutions = list(substitutions)

    def _text(self, context: LaunchContext) -> str:
        return os.path.join(*(text(context, part) for part in self.substitutions))

    def describe(self) -> str:
        """Its parts."""
        return "/".join(map(describe, self.substitutions))


class Command(Substitution):
    """The output of `xacro FILE name:=value ...` or `cat FILE`. No other program is run."""

    def __init__(self, command: Text, *, on_stderr: str = "fail") -> None:
        self.command = command

    def _text(self, context: LaunchContext) -> str:
        return _output(text(context, self.command))


class FindExecutable(Substitution):
    """The path of a program."""

    def __init__(self, *, name: Text) -> None:
        self.name = name

    def _text(self, context: LaunchContext) -> str:
        name = text(context, self.name)
        if name in REPLACED:
            return name
        found = shutil.which(name)
        if found is None:
            raise LaunchError(f"no program {name!r} on the PATH")
        return found


class EnvironmentVariable(Substitution):
    """The value of an environment variable."""

    def __init__(self, name: Text, *, default_value: Any = None) -> None:
        self.name, self.default = name, default_value

    def _text(self, context: LaunchContext) -> str:
        name = text(context, self.name)
        if name in context.environment:
            return context.environment[name]
        if self.default is None:
            raise LaunchError(
                f"the environment variable {name!r} is not set; set it, or give default_value"
            )
        return text(context, self.default)


class PythonExpression(Substitution):
    """The value of a Python expression, with the names of math; `python_modules` adds other
    modules.
    """

    def __init__(self, expression: Text, python_modules: Any = ()) -> None:
        self.expression, self.modules = expression, list(python_modules)

    def _text(self, context: LaunchContext) -> str:
        source = text(context, self.expression)
        try:
            names = {"math": math, **vars(math)}
            names |= {
                name: __import__(name)
                for name in (text(context, module) for module in self.modules)
            }
            return str(eval(source, names))
        except Exception as error:
            raise LaunchError(
                f"PythonExpression {source!r}: {type(error).__name__}: {error}"
            ) from None


class ThisLaunchFile(Substitution):
    """The path of the launch file."""

    def _text(self, context: LaunchContext) -> str:
        return str(context.file)


class ThisLaunchFileDir(Substitution):
    """The folder of the launch file."""

    def _text(self, context: LaunchContext) -> str:
        return str(context.file.parent)


class FileContent(Substitution):
    """The content of a file."""

    def __init__(self, path: Text) -> None:
        self.path = path

    def _text(self, context: LaunchContext) -> str:
        path = text(context, self.path)
        try:
            return Path(path).read_text()
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", "") or "not a text file"
            raise LaunchError(f"cannot read {path}: {reason}") from None


class AnonName(Substitution):
    """A unique name."""

    def __init__(self, name: Text) -> None:
        self.name = name

    def _text(self, context: LaunchContext) -> str:
        return f"{text(context, self.name)}_{os.getpid()}"


class FindPackageShare(Substitution):
    """The folder of a package, with its urdf, launch and worlds."""

    def __init__(self, package: Text) -> None:
        self.package = package

    def _text(self, context: LaunchContext) -> str:
        return str(self._folder(context))

    def find(self, package_name: str) -> str:
        """The folder of any package, at once. Raises LaunchError."""
        return type(self)(package_name).perform(LaunchContext())

    def describe(self) -> str:
        """The package."""
        return f"share of {describe(self.package)}"

    def _folder(self, context: LaunchContext) -> Path:
        return packages.find(text(context, self.package)).absolute()


class FindPackagePrefix(FindPackageShare):
    """Where a package is installed; the folder of its sources if it is not."""

    def _text(self, context: LaunchContext) -> str:
        return str(packages.prefix(self._folder(context)))


FindPackage = FindPackagePrefix


class ExecutableInPackage(Substitution):
    """The path of an executable of a package."""

    def __init__(self, executable: Text, package: Text) -> None:
        self.executable, self.package = executable, package

    def _text(self, context: LaunchContext) -> str:
        package, executable = text(context, self.package), text(context, self.executable)
        return str(executables.find(package, executable, nameless=True).path)


class EqualsSubstitution(Substitution):
    """true if two texts are equal, otherwise false."""

    def __init__(self, left: Any, right: Any) -> None:
        self.left, self.right = left, right

    def _text(self, context: LaunchContext) -> str:
        return _word(_side(context, self.left) == _side(context, self.right))


class NotEqualsSubstitution(EqualsSubstitution):
    """false if two texts are equal, otherwise true."""

    def _text(self, context: LaunchContext) -> str:
        return _word(_side(context, self.left) != _side(context, self.right))


class NotSubstitution(Substitution):
    """true for false, and false for true."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def _text(self, context: LaunchContext) -> str:
        return _word(not truth(context, self.value, "the value of NotSubstitution"))


class AndSubstitution(Substitution):
    """true if both values are."""

    def __init__(self, left: Any, right: Any) -> None:
        self.left, self.right = left, right

    def _text(self, context: LaunchContext) -> str:
        return _word(all(self._values(context)))

    def _values(self, context: LaunchContext) -> list[bool]:
        return [
            truth(context, side, f"a value of {type(self).__name__}")
            for side in (self.left, self.right)
        ]


class OrSubstitution(AndSubstitution):
    """true if one of two values is."""

    def _text(self, context: LaunchContext) -> str:
        return _word(any(self._values(context)))


class IfElseSubstitution(Substitution):
    """One of two texts, depending on a condition."""

    def __init__(self, condition: Any, if_value: Text = "", else_value: Text = "") -> None:
        self.condition, self.if_value, self.else_value = condition, if_value, else_value

    def _text(self, context: LaunchContext) -> str:
        holds = truth(context, self.condition, "the condition of IfElseSubstitution")
        return text(context, self.if_value if holds else self.else_value)


def _side(context: LaunchContext, value: Any) -> str:
    return (
        _word(value)
        if isinstance(value, bool)
        else str(value)
        if value is None
        else text(context, value)
    )


def _word(value: bool) -> str:
    return str(value).lower()


def _output(command: str) -> str:
    """The output of a command. Raises LaunchError, or RobotError for the file."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise LaunchError(f"Command {command!r}: {error}") from None
    for start in (["ros2", "run", "xacro"], ["python3", "-m"]):
        if words[: len(start)] == start:
            del words[: len(start)]
    name = Path(words[0]).name if words else ""
    if name == "cat" and len(words) == 2:
        return descriptions.read(Path(words[1]))
    if name not in ("xacro", "xacro.py"):
        joined = "; its parts are joined as they are: write 'xacro ', with the space"
        hint = joined if command.startswith("xacro") else ""
        problem = "only `xacro FILE name:=value ...` and `cat FILE` are run here"
        raise LaunchError(f"Command {command!r:.200}: {problem}{hint}")
    words = [word for word in words[1:] if word not in _IGNORED]
    files = [word for word in words if ":=" not in word]
    if len(files) != 1 or files[0].startswith("-"):
        raise LaunchError(f"Command {command!r:.200}: write `xacro FILE name:=value ...`")
    return descriptions.expand(
        Path(files[0]), dict(word.split(":=", 1) for word in words if ":=" in word)
    )
