"""launch.event_handlers and launch.events: actions for when a process starts or ends, or the launch
does.
"""

from typing import Any

from holozen.ros.launch.launch_context import LaunchContext, here
from holozen.ros.launch.launch_description import Action, Entities, checked

__all__ = ["OnExecutionComplete", "OnProcessExit", "OnProcessStart", "OnShutdown", "Shutdown"]


class Event:
    """Something that happened."""


class ProcessStarted(Event):
    """The process of `action` has started."""

    def __init__(self, action: Action, name: str) -> None:
        self.action, self.process_name = action, name


class ProcessExited(ProcessStarted):
    """The process of `action` has ended."""

    def __init__(self, action: Action, name: str, returncode: int) -> None:
        super().__init__(action, name)
        self.returncode = returncode


class Shutdown(Event):
    """The launch ends."""

    def __init__(
        self, *, reason: str = "the launch file requested it", due_to_sigint: bool = False
    ) -> None:
        self.reason, self.due_to_sigint = reason, due_to_sigint


class EventHandler:
    """Executes actions at an event of the process of `target_action`, or of any process if that is
    None.

    With `handle_once`, only the first time.
    """

    event: type[Event] = Event

    def __init__(self, target_action: Any, actions: Any, handle_once: bool = False) -> None:
        self.place, self._once, self._done = here(), handle_once, False
        is_filter = callable(target_action) and not isinstance(target_action, Action)
        self.target: Any = None if is_filter else target_action
        self.filter: Any = target_action if is_filter else None
        self.actions = actions if callable(actions) else checked(actions or (), self.place)

    def handle(self, event: Event, context: LaunchContext) -> Entities:
        """The actions to execute now; none if the event is not handled."""
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


class OnProcessExit(EventHandler):
    """When a process has ended."""

    event = ProcessExited

    def __init__(
        self, *, target_action: Any = None, on_exit: Any, handle_once: bool = False
    ) -> None:
        super().__init__(target_action, on_exit, handle_once)


class OnExecutionComplete(EventHandler):
    """When an action is complete: its process has ended."""

    event = ProcessExited

    def __init__(
        self, *, target_action: Any = None, on_completion: Any, handle_once: bool = False
    ) -> None:
        super().__init__(target_action, on_completion, handle_once)


class OnProcessStart(EventHandler):
    """When a process has started."""

    event = ProcessStarted

    def __init__(
        self, *, target_action: Any = None, on_start: Any, handle_once: bool = False
    ) -> None:
        super().__init__(target_action, on_start, handle_once)


class OnShutdown(EventHandler):
    """When the launch ends."""

    event = Shutdown

    def __init__(self, *, on_shutdown: Any, handle_once: bool = True) -> None:
        super().__init__(None, on_shutdown, handle_once)
