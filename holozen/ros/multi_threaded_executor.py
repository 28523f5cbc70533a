"""An executor whose callbacks run in several threads."""

import os
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from holozen.ros.context import Context
from holozen.ros.entity import Entity, Work
from holozen.ros.executor import Executor


class MultiThreadedExecutor(Executor):
    """Runs callbacks in `num_threads` threads (by default as many as there are processors, at least two).

    Which of them run at the same time is said by their callback groups. Of a node that has only its default group
    they do not.
    """

    def __init__(self, num_threads: int | None = None, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._most = max(2, os.cpu_count() or 2) if num_threads is None else num_threads
        if self._most < 1:
            raise ValueError(f"num_threads is {num_threads}; use 1 or more")
        self._work: deque[Work] = deque()
        self._there = threading.Semaphore(0)  # counts what is in `_work`
        self._threads: list[threading.Thread] = []
        self._busy = 0
        self._lock = threading.Lock()
        self._errors: deque[BaseException] = deque()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Spin no more. Waits for the callbacks that run; whether they have ended in time."""
        super().shutdown()
        deadline = None if timeout_sec is None else time.monotonic() + timeout_sec
        for _ in self._threads:
            self._there.release()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(None if deadline is None else max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads if thread is not threading.current_thread())

    def _next(self) -> Work | None:
        # What waits for a thread waits where it came in, so that the newest are kept.
        return None if self._busy >= self._most else super()._next()

    def _check(self, reached: Callable[[], bool]) -> None:
        if self._errors:
            raise self._errors.popleft()
        super()._check(reached)

    def _execute(self, entity: Entity, work: Callable[[], Any]) -> None:
        with self._lock:
            self._busy += 1
        if self._busy > len(self._threads):
            thread = threading.Thread(target=self._serve, daemon=True)
            self._threads.append(thread)
            thread.start()
        self._work.append((entity, work))
        self._there.release()

    def _serve(self) -> None:
        while self._there.acquire() and self._work:
            try:
                self._run(*self._work.popleft())
            except BaseException as error:  # raised again by who spins
                self._errors.append(error)
            with self._lock:
                self._busy -= 1
            self.wake()
