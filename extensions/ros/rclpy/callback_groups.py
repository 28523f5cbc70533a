"""Callback groups: which callbacks may run at the same time in an executor with several threads."""

import threading
import weakref
from typing import Any

__all__ = ["CallbackGroup", "MutuallyExclusiveCallbackGroup", "ReentrantCallbackGroup"]


class CallbackGroup:
    """Callbacks that share a rule. Create it first: `create_subscription(...,
    callback_group=group)`.
    """

    def __init__(self) -> None:
        self.entities: weakref.WeakSet[Any] = weakref.WeakSet()

    def add_entity(self, entity: Any) -> None:
        """Make a subscription, timer and so on a member."""
        self.entities.add(entity)

    def has_entity(self, entity: Any) -> bool:
        """Whether it is a member."""
        return entity in self.entities

    def can_execute(self, entity: Any) -> bool:
        """Whether the callback of a member may start now."""
        raise NotImplementedError

    def beginning_execution(self, entity: Any) -> bool:
        """Start the callback of a member, if it may start. Returns whether it does."""
        raise NotImplementedError

    def ending_execution(self, entity: Any) -> None:
        """The callback of a member has ended."""
        raise NotImplementedError


class ReentrantCallbackGroup(CallbackGroup):
    """All its callbacks may run at the same time, even the same one more than once."""

    def can_execute(self, entity: Any) -> bool:
        """Always."""
        return True

    def beginning_execution(self, entity: Any) -> bool:
        """Always."""
        return True

    def ending_execution(self, entity: Any) -> None:
        """Does nothing."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """One of its callbacks runs at a time. A node has one such group for everything created without
    a group.
    """

    def __init__(self) -> None:
        super().__init__()
        self._busy = threading.Lock()

    def can_execute(self, entity: Any) -> bool:
        """Whether none is running."""
        return not self._busy.locked()

    def beginning_execution(self, entity: Any) -> bool:
        """Whether none was running; now this one is."""
        return self._busy.acquire(blocking=False)

    def ending_execution(self, entity: Any) -> None:
        """It has ended."""
        self._busy.release()
