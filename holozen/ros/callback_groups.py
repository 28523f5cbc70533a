"""Which callbacks may run at the same time in an executor with several threads."""

import threading
import weakref
from typing import Any

__all__ = ["CallbackGroup", "MutuallyExclusiveCallbackGroup", "ReentrantCallbackGroup"]


class CallbackGroup:
    """Callbacks that share a rule. Made before what it is for: `create_subscription(..., callback_group=group)`."""

    def __init__(self) -> None:
        self.entities: weakref.WeakSet[Any] = weakref.WeakSet()

    def add_entity(self, entity: Any) -> None:
        """Make something with a callback a member."""
        self.entities.add(entity)

    def has_entity(self, entity: Any) -> bool:
        """Whether it is a member."""
        return entity in self.entities

    def can_execute(self, entity: Any) -> bool:
        """Whether the callback of a member may begin now."""
        raise NotImplementedError

    def beginning_execution(self, entity: Any) -> bool:
        """The callback of a member begins, if it may; whether it does."""
        raise NotImplementedError

    def ending_execution(self, entity: Any) -> None:
        """The callback of a member has ended."""
        raise NotImplementedError


class ReentrantCallbackGroup(CallbackGroup):
    """Its callbacks may all run at the same time, also the same one twice."""

    def can_execute(self, entity: Any) -> bool:
        """Always."""
        return True

    def beginning_execution(self, entity: Any) -> bool:
        """Always."""
        return True

    def ending_execution(self, entity: Any) -> None:
        """Nothing has to be done."""


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    """Of its callbacks one runs at a time. A node has one such group for all that is given none."""

    def __init__(self) -> None:
        super().__init__()
        self._busy = threading.Lock()

    def can_execute(self, entity: Any) -> bool:
        """Whether none runs."""
        return not self._busy.locked()

    def beginning_execution(self, entity: Any) -> bool:
        """Whether none ran; now this one does."""
        return self._busy.acquire(blocking=False)

    def ending_execution(self, entity: Any) -> None:
        """It has ended."""
        self._busy.release()
