"""GuardCondition: lets any thread run a callback in the executor."""

from collections.abc import Callable
from typing import Any

from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.inbox import Waker

__all__ = ["GuardCondition"]


class GuardCondition:
    """Made by `Node.create_guard_condition`. Triggers that come while one waits are one."""

    def __init__(self, callback: Callable[[], Any] | None, callback_group: CallbackGroup | None) -> None:
        self.callback, self.callback_group = callback, callback_group
        self._triggered = False
        self._waker = Waker()

    def trigger(self) -> None:
        """Let the callback run."""
        self._triggered = True
        self._waker.wake()

    def take(self) -> Callable[[], Any] | None:
        """The callback if it was triggered."""
        if not self._triggered:
            return None
        self._triggered = False
        return self.callback or _nothing

    def arm(self, waker: Waker) -> None:
        """Wake `waker` when it is triggered."""
        self._waker = waker

    def silence(self) -> None:
        """Run the callback no more; its node is about to leave."""
        self.destroy()

    def destroy(self) -> None:
        """Run the callback no more."""
        self.callback, self._triggered = None, False


def _nothing() -> None:
    """What a guard condition without a callback runs."""
