"""What executors run."""

from collections.abc import Callable
from typing import Any, Protocol

from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.inbox import Waker


class Entity(Protocol):
    """What an executor looks at: a subscription, timer, service, guard condition, or tasks."""

    callback_group: CallbackGroup | None

    def take(self) -> Callable[[], Any] | None:
        """The next callback with its arguments, or None. Takes it out, so the caller runs it."""
        ...

    def arm(self, waker: Waker) -> None:
        """Wake `waker` when there is something to take."""
        ...


Work = tuple[Entity, Callable[[], Any]]
