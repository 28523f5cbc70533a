"""What executors wait for: where samples and requests are queued, and how an executor is woken.

No work is done in Zenoh's threads. Samples wait in a ring channel, which costs no Python at all.
Only while an executor blocks, one thread per inbox waits in the ring's `recv` and wakes it.

In all that a script's main thread runs, bare locks and SimpleQueue stand where Condition, Event and
Semaphore might: Ctrl-C in the instant in which one of those has just taken its lock leaves it
locked, and the script would not end.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, Generic, TypeVar

from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.suggest import article
from holozen.transport.errors import BusError

__all__ = ["GuardCondition"]

T = TypeVar("T")

LATE = 2.0  # s that a callback may wait for another one before that is reported
MAX_WAIT = 3600.0  # s of one wait; a lock accepts no much larger number


def check_callback(callback: object) -> None:
    """Raise TypeError for what cannot be called."""
    if not callable(callback):
        hint = "; write the function's name without ()" if callback is None else ""
        given = article(type(callback).__name__)
        raise TypeError(f"a callback must be a function, and {callback!r} is {given}{hint}")


def deadline(timeout_sec: float | None) -> float:
    """When a timeout in s ends, by the monotonic clock; never for None or a negative one."""
    return math.inf if timeout_sec is None or timeout_sec < 0 else time.monotonic() + timeout_sec


class Waker:
    """Wakes the one thread that waits in it. That thread sets `waiting` before it looks for work a
    last time.
    """

    def __init__(self) -> None:
        self.waiting = False
        # A bare lock and not an Event: a signal handler may release it while it interrupts any of
        # these lines.
        self._lock = threading.Lock()
        self._lock.acquire()

    def wake(self) -> None:
        """End the wait, or the next one."""
        try:
            self._lock.release()
        except RuntimeError:  # it was woken already
            pass

    def wait(self, seconds: float) -> bool:
        """Wait until woken, at most `seconds`. Returns whether it was woken."""
        return self._lock.acquire(timeout=min(seconds, MAX_WAIT))


class Waitable:
    """A subscription, timer, service, guard condition or task queue, as an executor sees it."""

    callback_group: CallbackGroup | None
    _waker = Waker()  # until an executor waits

    def take(self) -> Callable[[], Any] | None:
        """The next callback with its arguments, which the caller has to run; None if there is
        none.
        """
        raise NotImplementedError

    def arm(self, waker: Waker) -> None:
        """Wake `waker` as soon as there is something to take."""
        self._waker = waker


Work = tuple[Waitable, Callable[[], Any]]


class Inbox(Generic[T]):
    """The newest `depth` items from the `recv` and `try_recv` of a ring channel of that depth, in
    order.
    """

    def __init__(self, recv: Callable[[], T], try_recv: Callable[[], T | None], depth: int) -> None:
        self._recv, self._try_recv = recv, try_recv
        self._items: deque[T] = deque(maxlen=depth)
        self._waker = Waker()
        self._lock = threading.Lock()  # protects `parked`
        self.parked = True  # while the thread is parked, `take` reads the ring itself
        # an item for each time that the thread may wait in the ring
        self._go: SimpleQueue[None] = SimpleQueue()
        self.thread: threading.Thread | None = None
        self._closed = False

    def take(self) -> T | None:
        """The oldest item, or None. For one thread at a time."""
        if self.parked:
            self._drain()
        return self._items.popleft() if self._items else None

    def arm(self, waker: Waker) -> None:
        """Let the thread wait for the next item and wake `waker` then. `waker.waiting` must be set
        before.
        """
        self._waker = waker
        with self._lock:
            if not self.parked or self._closed:
                return
            # or items from before could be taken before the thread has seen newer ones
            self._drain()
            self.parked = False
        if self.thread is None:
            self.thread = threading.Thread(target=self._read, daemon=True)
            self.thread.start()
        self._go.put(None)

    def close(self) -> None:
        """Let the thread end. If it waits in the ring, the end of the ring ends it."""
        with self._lock:
            self._closed = True
        self._go.put(None)

    def _drain(self) -> None:
        while (item := self._try_recv()) is not None:
            self._items.append(item)

    def _read(self) -> None:
        while True:
            self._go.get()
            if self._closed:
                return
            while self._receive():
                pass

    def _receive(self) -> bool:
        """Receive one item. Returns whether to wait for another: a busy executor reads the ring
        itself.
        """
        try:
            self._items.append(self._recv())
        except BusError:
            self._closed = True
            return False
        with self._lock:
            # An executor that starts waiting now arms this inbox after it has set `waiting`.
            if self._waker.waiting:
                self._waker.wake()
                return True
            self.parked = True
            return False


class GuardCondition(Waitable):
    """Created by `Node.create_guard_condition`. Triggers that arrive before the callback runs count
    as one.
    """

    def __init__(
        self, callback: Callable[[], Any] | None, callback_group: CallbackGroup | None
    ) -> None:
        self.callback, self.callback_group = callback, callback_group
        self._triggered = False

    def trigger(self) -> None:
        """Let the callback run."""
        self._triggered = True
        self._waker.wake()

    def take(self) -> Callable[[], Any] | None:
        """The callback if it was triggered."""
        if not self._triggered:
            return None
        self._triggered = False
        return self.callback or (lambda: None)

    def destroy(self) -> None:
        """Never run the callback again."""
        self.callback, self._triggered = None, False

    detach = destroy
