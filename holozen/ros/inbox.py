"""Where samples and requests wait for an executor, and how it is woken.

Nothing works in Zenoh's threads. What comes waits in a ring channel, which costs no Python at all. Only where an
executor waits for something to come, a thread per inbox waits in the ring's `recv`, and wakes it.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from holozen.errors import BusError

T = TypeVar("T")

LONGEST = 3600.0  # s of one wait; the lock below takes no number that is much larger


class Waker:
    """Wakes the one thread that waits in it. `waiting` is set by that thread, before its last look around."""

    def __init__(self) -> None:
        self.waiting = False
        # A bare lock, and no Event: it may be released from a signal handler that interrupted any of these lines.
        self._lock = threading.Lock()
        self._lock.acquire()

    def wake(self) -> None:
        """End the wait, or the next one."""
        try:
            self._lock.release()
        except RuntimeError:  # somebody was faster
            pass

    def wait(self, seconds: float | None) -> bool:
        """Wait until somebody wakes, at most so long; whether somebody did."""
        return self._lock.acquire(timeout=LONGEST if seconds is None else min(seconds, LONGEST))


class Inbox(Generic[T]):
    """The newest `depth` of what `recv` and `try_recv` of a ring channel with that depth give, in order."""

    def __init__(self, recv: Callable[[], T], try_recv: Callable[[], T | None], depth: int) -> None:
        self._recv, self._try_recv = recv, try_recv
        self._came: deque[T] = deque(maxlen=depth)
        self._waker = Waker()
        self._lock = threading.Lock()  # around `_parked`
        self._parked = True  # the thread reads nothing, so who takes may
        self._go = threading.Semaphore(0)
        self.thread: threading.Thread | None = None
        self._closed = False

    def take(self) -> T | None:
        """The oldest that waits, or None. For one thread at a time."""
        if self._parked:
            self._drain()
        return self._came.popleft() if self._came else None

    def arm(self, waker: Waker) -> None:
        """Let the thread wait for the next one, and wake `waker` then. `waker.waiting` is set before."""
        self._waker = waker
        with self._lock:
            if not self._parked or self._closed:
                return
            self._drain()  # else what came earlier would be taken before the thread has seen that newer ones wait
            self._parked = False
        if self.thread is None:
            self.thread = threading.Thread(target=self._read, daemon=True)
            self.thread.start()
        self._go.release()

    def _drain(self) -> None:
        while (item := self._try_recv()) is not None:
            self._came.append(item)

    def close(self) -> None:
        """Let the thread end, if it does not wait in the ring, whose own end ends that."""
        with self._lock:
            self._closed = True
        self._go.release()

    def _read(self) -> None:
        while self._go.acquire() and not self._closed:
            while self._stays_awake():
                pass

    def _stays_awake(self) -> bool:
        """Take in one; whether the executor waits for the next one too. Where it is busy it reads the ring itself."""
        try:
            self._came.append(self._recv())
        except BusError:
            self._closed = True
            return False
        with self._lock:
            # An executor that begins to wait now arms this inbox after it has said so.
            if self._waker.waiting:
                self._waker.wake()
                return True
            self._parked = True
            return False
