"""Future: a result that arrives later. Task: a function or coroutine that an executor runs."""

import inspect
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.waitable import Waitable

__all__ = ["Future", "Task"]


class Future(HelpfulAttributes):
    """A result that arrives later, as from `Client.call_async`. Done callbacks run in the executor
    if there is one.
    """

    # `__del__` reads it, also where Ctrl-C came during `__init__`
    _exception: Exception | None = None

    def __init__(self, *, executor: Any = None) -> None:
        self._executor = executor
        self._lock = threading.Lock()
        self._done = self._cancelled = self._is_retrieved = False
        self._result: Any = None
        self._callbacks: list[Callable[[Any], Any]] = []
        self._watchers: list[Callable[[], object]] = []

    def __del__(self) -> None:
        if self._exception is not None and not self._is_retrieved:
            kind = type(self).__name__
            print(
                f"the exception of a {kind} was never retrieved: {self._exception!r}",
                file=sys.stderr,
            )

    def __await__(self) -> Generator["Future", None, Any]:
        while not self.done():
            yield self
        return self.result()

    def cancel(self) -> None:
        """Cancel it, if it is not done."""
        self._finish(cancelled=True)

    def cancelled(self) -> bool:
        """Whether it was cancelled."""
        return self._cancelled

    def done(self) -> bool:
        """Whether it has a result or an exception, or was cancelled."""
        return self._done

    def result(self) -> Any:
        """The result; None while there is none. Raises the exception if that was set instead."""
        if exception := self.exception():
            raise exception
        return self._result

    def exception(self) -> Exception | None:
        """The exception that was set instead of a result, or None."""
        self._is_retrieved = True
        return self._exception

    def set_result(self, result: Any) -> None:
        """Finish it with a result."""
        self._finish(result)

    def set_exception(self, exception: Exception) -> None:
        """Finish it with an exception."""
        self._finish(exception=exception)

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        """Call `callback(future)` when it is done: in the executor, or at once if there is none."""
        with self._lock:
            if not self._done:
                self._callbacks.append(callback)
                return
        self._call(callback)

    def remove_done_callback(self, callback: Callable[[Any], Any]) -> int:
        """Remove a callback; how many times it had been added."""
        with self._lock:
            kept = [one for one in self._callbacks if one != callback]
            removed = len(self._callbacks) - len(kept)
            self._callbacks = kept
        return removed

    def watch(self, watcher: Callable[[], object]) -> None:
        """Call `watcher()`, which must be quick, in the thread that finishes it; at once if it is
        done.
        """
        with self._lock:
            if not self._done:
                self._watchers.append(watcher)
                return
        watcher()

    def unwatch(self, watcher: Callable[[], object]) -> None:
        """Undo `watch`."""
        with self._lock:
            self._watchers = [one for one in self._watchers if one != watcher]

    def _finish(
        self, result: Any = None, exception: Exception | None = None, cancelled: bool = False
    ) -> None:
        with self._lock:
            if self._done:
                return
            self._result, self._exception, self._cancelled, self._done = (
                result,
                exception,
                cancelled,
                True,
            )
            callbacks, watchers, self._callbacks, self._watchers = (
                self._callbacks,
                self._watchers,
                [],
                [],
            )
        for watcher in watchers:
            watcher()
        for callback in callbacks:
            self._call(callback)

    def _call(self, callback: Callable[[Any], Any]) -> None:
        if self._executor is not None:
            self._executor.create_task(callback, self)
        else:
            callback(self)


class Task(Future):
    """A function with its arguments, or a coroutine, that an executor runs; also the future of what
    it returns.
    """

    def __init__(
        self,
        handler: Any,
        args: Any = None,
        kwargs: Any = None,
        executor: Any = None,
        reschedule: Callable[["Task"], object] = lambda task: None,
    ) -> None:
        super().__init__(executor=executor)
        self._args, self._kwargs, self._reschedule = args or (), kwargs or {}, reschedule
        self._coroutine = handler if inspect.iscoroutine(handler) else None
        self._handler = handler
        self._running = threading.Lock()

    def __call__(self) -> None:
        """Run it to its end or, if it is a coroutine, to its next await."""
        # what it awaits may be done before the thread that ran it last has left
        with self._running:
            if not self._done:
                self._step()

    def executing(self) -> bool:
        """Whether it is running now."""
        return self._running.locked()

    def _step(self) -> None:
        try:
            if self._coroutine is None:
                result = self._handler(*self._args, **self._kwargs)
                if not inspect.iscoroutine(result):
                    return self.set_result(result)
                self._coroutine = result
            awaited = self._coroutine.send(None)
        except StopIteration as end:
            return self.set_result(end.value)
        except Exception as error:
            return self.set_exception(error)
        if isinstance(awaited, Future):
            awaited.watch(lambda: self._reschedule(self))
        else:
            self._reschedule(self)


class TaskQueue(Waitable):
    """Tasks that wait for an executor, in order."""

    def __init__(self, callback_group: CallbackGroup | None = None) -> None:
        self.callback_group = callback_group
        self._waiting: deque[Task] = deque()

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Queue a function or a coroutine."""
        task = Task(callback, args, kwargs, self, reschedule=self._add)
        self._add(task)
        return task

    def take(self) -> Callable[[], None] | None:
        """The work of the oldest task, or None. The work raises what the task raises."""
        if not self._waiting:
            return None
        task = self._waiting.popleft()

        def work() -> None:
            task()
            if task.done():
                task.result()

        return work

    def _add(self, task: Task) -> None:
        self._waiting.append(task)
        self._waker.wake()
