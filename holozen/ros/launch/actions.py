"""launch.actions: what a launch file does besides starting nodes."""

import inspect
from typing import Any

from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action, Entities, checked
from holozen.ros.launch.events import Shutdown as ShutdownEvent
from holozen.ros.launch.processes import ExecuteProcess
from holozen.ros.launch.settings import (
    AppendEnvironmentVariable,
    DeclareLaunchArgument,
    SetEnvironmentVariable,
    SetLaunchConfiguration,
    UnsetEnvironmentVariable,
    UnsetLaunchConfiguration,
)
from holozen.ros.launch.sources import PythonLaunchDescriptionSource
from holozen.ros.launch.text import LaunchError, Text, number, pairs, text, truth
from holozen.tell import say

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

DEEPEST = 30  # launch files within launch files


class GroupAction(Action):
    """Several actions; what they set holds among them only, unless `scoped` is false."""

    def __init__(
        self, actions: Any, *, scoped: Any = True, forwarding: bool = True, launch_configurations: Any = None,
        **others: Any,
    ) -> None:  # fmt: skip
        super().__init__(**others)
        self.actions, self.scoped = checked(actions, self.place), scoped
        self.launch_configurations = dict(launch_configurations or {})

    def execute(self, context: LaunchContext) -> Entities:
        """The actions."""
        if truth(context, self.scoped, "scoped"):
            context.scope = context.scope.copy()
        for name, value in self.launch_configurations.items():
            context.launch_configurations[name] = text(context, value)
        return self.actions


class IncludeLaunchDescription(Action):
    """Another launch file, with values for its arguments."""

    def __init__(self, launch_description_source: Any, *, launch_arguments: Any = (), **others: Any) -> None:
        super().__init__(**others)
        source = launch_description_source
        self.source = source if hasattr(source, "load") else PythonLaunchDescriptionSource(source)
        self.launch_arguments = pairs(launch_arguments, "launch_arguments", self.place)

    def execute(self, context: LaunchContext) -> Entities:
        """What the file says. Raises LaunchError, and what the file itself does."""
        if len(context.scope.files) > DEEPEST:
            raise LaunchError(f"launch files within launch files, more than {DEEPEST} deep", self.place)
        for name, value in self.launch_arguments:
            context.launch_configurations[text(context, name)] = text(context, value)
        path, description = self.source.load(context)
        context.scope = context.scope.within(path)
        return [description]


class LogInfo(Action):
    """Says something."""

    def __init__(self, *, msg: Text, **others: Any) -> None:
        super().__init__(**others)
        self.msg = msg

    def execute(self, context: LaunchContext) -> None:
        """Say it."""
        say(text(context, self.msg))


class OpaqueFunction(Action):
    """Calls a function of the launch file with the context; what it returns is done next."""

    def __init__(self, *, function: Any, args: Any = (), kwargs: Any = None, **others: Any) -> None:
        super().__init__(**others)
        if not callable(function):
            raise LaunchError(f"function={function!r:.80} is no function", self.place)
        self.function, self.args, self.kwargs = function, list(args or ()), dict(kwargs or {})

    def execute(self, context: LaunchContext) -> Entities:
        """Call it. Raises what it raises."""
        found = self.function(context, *self.args, **self.kwargs)
        if inspect.isawaitable(found):
            raise LaunchError("OpaqueFunction calls plain functions here, not async ones", self.place)
        return checked(found, self.place) if found is not None else ()


class TimerAction(Action):
    """Actions after some seconds."""

    def __init__(self, *, period: Any, actions: Any, cancel_on_shutdown: Any = True, **others: Any) -> None:
        super().__init__(**others)
        self.period, self.actions = period, checked(actions, self.place)
        self._timer: object = None

    def execute(self, context: LaunchContext) -> None:
        """Wait, and do them then."""
        self._timer = context.stage.after(number(context, self.period, "period"), self.actions)
        self._stage = context.stage

    def cancel(self) -> None:
        """Do them never."""
        if self._timer is not None:
            self._stage.cancel(self._timer)


class RegisterEventHandler(Action):
    """Has something done when a process starts or ends."""

    def __init__(self, event_handler: Any, **others: Any) -> None:
        super().__init__(**others)
        self.event_handler = event_handler

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.stage.handle(self.event_handler)


class UnregisterEventHandler(RegisterEventHandler):
    """Has it done no more."""

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.stage.unhandle(self.event_handler)


class Shutdown(Action):
    """Ends the launch and all its processes."""

    def __init__(self, *, reason: Text = "the launch file says so", **others: Any) -> None:
        super().__init__(**others)
        self.reason = reason

    def execute(self, context: LaunchContext) -> None:
        """End it."""
        context.stage.stop(text(context, self.reason))


class EmitEvent(Action):
    """Ends the launch: launch.events.Shutdown is the only event that can be emitted here."""

    def __init__(self, *, event: Any, **others: Any) -> None:
        super().__init__(**others)
        if not isinstance(event, ShutdownEvent):
            raise LaunchError(
                f"EmitEvent(event={event!r:.80}): only launch.events.Shutdown() is known here", self.place
            )
        self.event = event

    def execute(self, context: LaunchContext) -> None:
        """End it."""
        context.stage.stop(self.event.reason)
