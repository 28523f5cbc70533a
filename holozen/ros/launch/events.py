"""launch.event_handlers and launch.events: what is done when processes start and end."""

from typing import Any

from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action, Entities, checked
from holozen.ros.launch.text import here

__all__ = ["OnExecutionComplete", "OnProcessExit", "OnProcessStart", "OnShutdown", "Shutdown"]


class Event:
    """Something that happened."""


class ProcessStarted(Event):
    """A process was started; `action` did it."""

    def __init__(self, action: Action, name: str) -> None:
        self.action, self.process_name = action, name


class ProcessExited(ProcessStarted):
    """A process has ended."""

    def __init__(self, action: Action, name: str, returncode: int) -> None:
        super().__init__(action, name)
        self.returncode = returncode


class Shutdown(Event):
    """The launch ends."""

    def __init__(self, *, reason: str = "the launch file says so", due_to_sigint: bool = False) -> None:
        self.reason, self.due_to_sigint = reason, due_to_sigint


class Handler:
    """Has actions done when something happens to the process of `target_action`, or to any if that is None.

    With `handle_once` that is done the first time only.
    """

    event: type[Event] = Event

    def __init__(self, target_action: Any, actions: Any, handle_once: bool = False) -> None:
        self.place, self._once, self._done = here(), handle_once, False
        is_filter = callable(target_action) and not isinstance(target_action, Action)
        self.target: Any = None if is_filter else target_action
        self.filter: Any = target_action if is_filter else None
        self.actions = actions if callable(actions) else checked(actions or (), self.place)

    def answer(self, event: Event, context: LaunchContext) -> Entities:
        """What is to be done now; nothing if the event is another one."""
        if type(event) is not self.event:
            return ()
        action = getattr(event, "action", None)
        if self.target not in (None, action) or (self.filter and not self.filter(action)):
            return ()
        if self._once and self._done:
            return ()
        self._done = True
        if callable(self.actions):
            found = self.actions(event, context)
            return checked(found, self.place) if found is not None else ()
        return self.actions


class OnProcessExit(Handler):
    """When a process has ended."""

    event = ProcessExited

    def __init__(self, *, target_action: Any = None, on_exit: Any, handle_once: bool = False) -> None:
        super().__init__(target_action, on_exit, handle_once)


class OnExecutionComplete(Handler):
    """When an action is over: its process has ended."""

    event = ProcessExited

    def __init__(self, *, target_action: Any = None, on_completion: Any, handle_once: bool = False) -> None:
        super().__init__(target_action, on_completion, handle_once)


class OnProcessStart(Handler):
    """When a process was started."""

    event = ProcessStarted

    def __init__(self, *, target_action: Any = None, on_start: Any, handle_once: bool = False) -> None:
        super().__init__(target_action, on_start, handle_once)


class OnShutdown(Handler):
    """When the launch ends."""

    event = Shutdown

    def __init__(self, *, on_shutdown: Any, handle_once: bool = True) -> None:
        super().__init__(None, on_shutdown, handle_once)
