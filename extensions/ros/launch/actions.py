"""launch.actions: the actions of a launch file, except for nodes (see launch_ros)."""

import inspect
import re
import shlex
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from holozen.cli import VERBS
from holozen.console import report
from holozen.ros.launch.event_handlers import Shutdown as ShutdownEvent
from holozen.ros.launch.launch_context import (
    LaunchContext,
    LaunchError,
    Program,
    Text,
    describe,
    number,
    pairs,
    text,
    truth,
)
from holozen.ros.launch.launch_description import Action, Entities, checked
from holozen.ros.launch.launch_description_sources import PythonLaunchDescriptionSource
from holozen.ros.launch.stand_ins import (
    INSTEAD,
    PROGRAMS,
    SCRIPTS,
    Executable,
    cannot_run,
    holozen_command,
    package_flags,
    skip,
    stand_in,
)

__all__ = [
    "AppendEnvironmentVariable",
    "DeclareLaunchArgument",
    "EmitEvent",
    "ExecuteProcess",
    "GroupAction",
    "IncludeLaunchDescription",
    "LogInfo",
    "OpaqueFunction",
    "RegisterEventHandler",
    "SetEnvironmentVariable",
    "SetLaunchConfiguration",
    "Shutdown",
    "TimerAction",
    "UnregisterEventHandler",
    "UnsetEnvironmentVariable",
    "UnsetLaunchConfiguration",
]

DEEPEST = 30  # levels of launch files that include one another
SHELL_NAME = "sh"
TERMINALS = (
    "gnome-terminal",
    "xterm",
    "konsole",
    "xfce4-terminal",
    "terminator",
    "lxterminal",
    "x-terminal-emulator",
)
_SHELL_SYNTAX = re.compile(r"[|&;<>()$`*?]")
_PYTHON = ("python", "python3")
_PYTHON_FLAGS = ("-u", "-B", "-O", "-OO", "-E", "-s", "-I")  # without a value


class DeclareLaunchArgument(Action):
    """An argument of the launch file. Its value comes from name:=value, from an including file, or
    is the default.
    """

    def __init__(
        self,
        name: str,
        *,
        default_value: Any = None,
        description: str = "",
        choices: Any = None,
        **others: Any,
    ) -> None:
        super().__init__(**others)
        self.name, self.default_value, self.description = name, default_value, description
        self.choices = list(choices) if choices else []

    def execute(self, context: LaunchContext) -> None:
        """Set its value. Raises LaunchError if there is none, or an invalid one."""
        values = context.launch_configurations
        context.used.add(self.name)
        if self.name not in values:
            if self.default_value is None:
                raise LaunchError(
                    f"launch argument {self.name!r} has no value; give {self.name}:=VALUE"
                )
            values[self.name] = text(context, self.default_value)
        if self.choices and values[self.name] not in self.choices:
            raise LaunchError(
                f"{self.name}:={values[self.name]}: it must be one of {', '.join(self.choices)}"
            )

    def summary(self) -> str:
        """The argument in one line."""
        default = (
            f"default: {describe(self.default_value)}"
            if self.default_value is not None
            else "required"
        )
        choices = f"; one of {', '.join(self.choices)}" if self.choices else ""
        return " ".join([f"{self.name}:=", *self.description.split(), f"({default}{choices})"])


class SetLaunchConfiguration(Action):
    """Changes the value of an argument."""

    def __init__(self, name: Text, value: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name, self.value = name, value

    def execute(self, context: LaunchContext) -> None:
        context.launch_configurations[text(context, self.name)] = text(context, self.value)


class UnsetLaunchConfiguration(Action):
    """Removes the value of an argument."""

    def __init__(self, name: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name = name

    def execute(self, context: LaunchContext) -> None:
        context.launch_configurations.pop(text(context, self.name), None)


class SetEnvironmentVariable(Action):
    """Sets an environment variable of the processes started later."""

    def __init__(self, name: Text, value: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name, self.value = name, value

    def execute(self, context: LaunchContext) -> None:
        context.environment[text(context, self.name)] = text(context, self.value)


class AppendEnvironmentVariable(SetEnvironmentVariable):
    """Appends to an environment variable of the processes started later."""

    def __init__(
        self, name: Text, value: Text, prepend: Any = False, separator: str = ":", **others: Any
    ) -> None:
        super().__init__(name, value, **others)
        self.prepend, self.separator = prepend, separator

    def execute(self, context: LaunchContext) -> None:
        """Append, or prepend, the value."""
        name = text(context, self.name)
        parts = [context.environment.get(name, ""), text(context, self.value)]
        parts = parts[::-1] if truth(context, self.prepend, "prepend") else parts
        context.environment[name] = self.separator.join(filter(None, parts))


class UnsetEnvironmentVariable(Action):
    """Removes an environment variable of the processes started later."""

    def __init__(self, name: Text, **others: Any) -> None:
        super().__init__(**others)
        self.name = name

    def execute(self, context: LaunchContext) -> None:
        context.environment.pop(text(context, self.name), None)


class GroupAction(Action):
    """Several actions. What they set is valid only among them, unless `scoped` is false."""

    def __init__(
        self,
        actions: Any,
        *,
        scoped: Any = True,
        forwarding: bool = True,
        launch_configurations: Any = None,
        **others: Any,
    ) -> None:
        super().__init__(**others)
        self.actions, self.scoped = checked(actions, self.place), scoped
        self.launch_configurations = dict(launch_configurations or {})

    def execute(self, context: LaunchContext) -> Entities:
        if truth(context, self.scoped, "scoped"):
            context.scope = context.scope.copy()
        for name, value in self.launch_configurations.items():
            context.launch_configurations[name] = text(context, value)
        return self.actions


class IncludeLaunchDescription(Action):
    """Another launch file, with values for its arguments."""

    def __init__(
        self, launch_description_source: Any, *, launch_arguments: Any = (), **others: Any
    ) -> None:
        super().__init__(**others)
        source = launch_description_source
        self.source = source if hasattr(source, "load") else PythonLaunchDescriptionSource(source)
        self.launch_arguments = pairs(launch_arguments, "launch_arguments", self.place)

    def execute(self, context: LaunchContext) -> Entities:
        """The description of the file. Raises LaunchError, and what the file raises."""
        if len(context.scope.files) > DEEPEST:
            raise LaunchError(f"launch files include one another more than {DEEPEST} levels deep")
        for name, value in self.launch_arguments:
            context.launch_configurations[text(context, name)] = text(context, value)
        path, description = self.source.load(context)
        context.scope = context.scope.within(path)
        return [description]


class LogInfo(Action):
    """Prints a message."""

    def __init__(self, *, msg: Text, **others: Any) -> None:
        super().__init__(**others)
        self.msg = msg

    def execute(self, context: LaunchContext) -> None:
        report(text(context, self.msg))


class OpaqueFunction(Action):
    """Calls a function of the launch file with the context, and executes the actions that it
    returns.
    """

    def __init__(self, *, function: Any, args: Any = (), kwargs: Any = None, **others: Any) -> None:
        super().__init__(**others)
        if not callable(function):
            raise LaunchError(f"function={function!r:.80} is not a function", self.place)
        self.function, self.args, self.kwargs = function, list(args or ()), dict(kwargs or {})

    def execute(self, context: LaunchContext) -> Entities:
        """Call it. Raises what it raises."""
        found = self.function(context, *self.args, **self.kwargs)
        if inspect.isawaitable(found):
            raise LaunchError("OpaqueFunction calls plain functions here, not async ones")
        return checked(found, self.place) if found is not None else ()


class TimerAction(Action):
    """Actions after some seconds."""

    def __init__(
        self, *, period: Any, actions: Any, cancel_on_shutdown: Any = True, **others: Any
    ) -> None:
        super().__init__(**others)
        self.period, self.actions = period, checked(actions, self.place)
        self._timer: object = None

    def execute(self, context: LaunchContext) -> None:
        self._timer = context.runner.after(number(context, self.period, "period"), self.actions)
        self._runner = context.runner

    def cancel(self) -> None:
        """Cancel the timer."""
        if self._timer is not None:
            self._runner.cancel(self._timer)


class RegisterEventHandler(Action):
    """Registers an event handler."""

    def __init__(self, event_handler: Any, **others: Any) -> None:
        super().__init__(**others)
        self.event_handler = event_handler

    def execute(self, context: LaunchContext) -> None:
        context.runner.register(self.event_handler)


class UnregisterEventHandler(RegisterEventHandler):
    """Removes an event handler."""

    def execute(self, context: LaunchContext) -> None:
        """Remove the handler."""
        context.runner.unregister(self.event_handler)


class Shutdown(Action):
    """Ends the launch and all its processes."""

    def __init__(self, *, reason: Text = "the launch file requested it", **others: Any) -> None:
        super().__init__(**others)
        self.reason = reason

    def execute(self, context: LaunchContext) -> None:
        context.runner.stop(text(context, self.reason))


class EmitEvent(Action):
    """Ends the launch: launch.events.Shutdown is the only event that can be emitted here."""

    def __init__(self, *, event: Any, **others: Any) -> None:
        super().__init__(**others)
        if not isinstance(event, ShutdownEvent):
            message = (
                f"EmitEvent(event={event!r:.80}): only launch.events.Shutdown() can be emitted here"
            )
            raise LaunchError(message, self.place)
        self.event = event

    def execute(self, context: LaunchContext) -> None:
        context.runner.stop(self.event.reason)


class ExecuteProcess(Action):
    """Starts a program. Python scripts run as by `holozen run`, and `ros2 topic ...` is `holozen
    topic ...`.

    Its output goes to the terminal, after its name. A `prefix` is ignored, and so is `emulate_tty`.
    """

    def __init__(
        self,
        *,
        cmd: Any = (),
        name: Text = "",
        cwd: Text = "",
        env: Any = None,
        additional_env: Any = None,
        shell: Any = False,
        output: Any = "screen",
        output_format: Any = "",
        prefix: Any = None,
        emulate_tty: Any = False,
        on_exit: Any = None,
        respawn: Any = False,
        respawn_delay: Any = 0.0,
        sigterm_timeout: Any = None,
        sigkill_timeout: Any = None,
        log_cmd: Any = False,
        **others: Any,
    ) -> None:
        super().__init__(**others)
        if isinstance(cmd, str):
            raise LaunchError(
                f"cmd={cmd!r} is one text; write a list of words, such as {cmd.split()!r}",
                self.place,
            )
        self.cmd, self.name, self.cwd, self.shell = list(cmd), name, cwd, shell
        self.env, self.additional_env, self.prefix = env, additional_env, prefix
        self.on_exit, self.respawn, self.respawn_delay = on_exit, respawn, respawn_delay

    @property
    def process_details(self) -> dict[str, Any]:
        """The words and the name, as event handlers read them in ROS."""
        return {"cmd": self.cmd, "name": self.name}

    def execute(self, context: LaunchContext) -> Entities | None:
        """Start it, or its replacement. Raises LaunchError."""
        words = [text(context, word) for word in self.cmd]
        if not words:
            raise LaunchError(f"{type(self).__name__} has no cmd")
        if truth(context, self.shell, "shell"):
            line = " ".join(words)
            words = _without_shell(line)
            if not words:
                self._start(context, [line], text(context, self.name) or SHELL_NAME, shell=True)
                return None
        return self._execute(context, words)

    def _execute(self, context: LaunchContext, words: list[str]) -> Entities | None:
        program = Path(words[0]).name
        if program in TERMINALS:
            skip(context, self, program, f"run this in another terminal: {_inside_terminal(words)}")
            return None
        if program in PROGRAMS:
            return PROGRAMS[program](context, Executable(self, "", program, words[1:]))
        if program == "ros2" and len(words) > 1:
            return self._ros2(context, words[1:])
        for name, found in INSTEAD.items():
            if found.reason and fnmatch(program, name.partition("/")[0]):
                skip(context, self, program, found.reason, lacks=found.lacks)
                return None
        name = text(context, self.name)
        if script := _python_script(words):
            name = name or Path(script[0]).name
            words = holozen_command(context, "run", *package_flags(), *script)
        self._start(context, words, name or program)
        return None

    def _ros2(self, context: LaunchContext, words: list[str]) -> Entities | None:
        """Run a verb of ROS's command line as ours with the same name."""
        verb, name = words[0], text(context, self.name) or f"ros2 {words[0]}"
        if verb == "run" and len(words) > 2:
            return self._run_node(context, Executable(self, words[1], words[2], words[3:]), name)
        if verb not in VERBS:
            skip(
                context,
                self,
                f"`ros2 {' '.join(words)[:100]}`",
                f"there is no verb {verb!r} here",
                ends=True,
            )
            return None
        self._start(context, holozen_command(context, verb, *words[1:]), name)
        return None

    def _run_node(
        self,
        context: LaunchContext,
        node: Executable,
        name: str,
        ros_words: list[str] | None = None,
    ) -> Entities | None:
        """Start an executable of a package by `holozen run`, or its replacement. Raises Failure."""
        replacement = stand_in(context, node)
        if replacement is not None:
            return replacement
        prefix = text(context, self.prefix or "").partition(" ")[0]
        if prefix.rpartition("/")[2] in TERMINALS:
            hint = f"run it in another terminal: holozen run {node.package} {node.name}"
            skip(context, self, f"{node.package} {node.name}", hint)
            return None
        ours = SCRIPTS.get(f"{node.package}/{node.name}")
        # Here, where the launch file's line is known.
        if not ours and not _is_python(node.name) and (why := cannot_run(node)):
            skip(context, self, node.shown, why[0], lacks=why[1])
            return None
        line = [node.name, *node.words, *(ros_words or [])]
        if ours:
            line[0] = str(ours)
        elif node.package:
            line.insert(0, node.package)
        elif _is_python(node.name):
            line = _python_script(line)
            if not line:
                raise LaunchError(
                    f"{node.name} without a script; write arguments=['SCRIPT.py'], or an "
                    "ExecuteProcess"
                )
        words = holozen_command(
            context, "run", *package_flags(*([] if ours else [node.package])), *line
        )
        self._start(context, words, name or Path(line[0] if not node.package else node.name).name)
        return None

    def _start(
        self, context: LaunchContext, words: list[str], name: str, shell: bool = False
    ) -> None:
        environment = context.environment if self.env is None else _evaluated(context, self.env)
        environment = {**environment, **_evaluated(context, self.additional_env or {})}
        is_respawned = truth(context, self.respawn, "respawn")
        delay = (
            number(context, self.respawn_delay or 0.0, "respawn_delay") if is_respawned else None
        )
        folder = text(context, self.cwd) if self.cwd else None
        if folder is not None and not Path(folder).is_dir():
            raise LaunchError(f"cwd={folder!r} is not a folder")
        context.runner.start(self, Program(name, words, folder, environment, shell, respawn=delay))


def _is_python(program: str) -> bool:
    name = Path(program).name
    return name in _PYTHON or name.startswith("python3.")


def _python_script(words: list[str]) -> list[str]:
    """The script that the words start by Python, and its own words; empty if they start none."""
    left = words[1:] if _is_python(words[0]) else []
    while left and left[0] in _PYTHON_FLAGS:
        del left[0]
    return left if left and left[0].endswith(".py") else []


def _without_shell(line: str) -> list[str]:
    """The words of a shell command that starts one of ROS's programs and needs no shell; empty for
    any other.
    """
    try:
        words = shlex.split(line)
    except ValueError:
        return []
    known = bool(words) and Path(words[0]).name in (*PROGRAMS, "ros2")
    return words if known and not _SHELL_SYNTAX.search(line) else []


def _inside_terminal(words: list[str]) -> str:
    """The command that a terminal would run, with the verb of ours for one of ROS's."""
    words = words[1:]
    while words and words[0].startswith("-"):
        words = words[1:]
    return shlex.join(["holozen", *words[1:]] if words[:1] == ["ros2"] else words)


def _evaluated(context: LaunchContext, variables: Any) -> dict[str, str]:
    items = variables.items() if hasattr(variables, "items") else variables
    return {text(context, name): text(context, value) for name, value in items}
