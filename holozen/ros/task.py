"""Future: a result that comes later. Task: a function or coroutine that an executor runs. Tasks: those that wait."""

import inspect
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.inbox import Waker
from holozen.ros.missing import Told

__all__ = ["Future", "Task"]


class Future(Told):
    """A result that comes later, as `Client.call_async` gives. Done callbacks run in the executor, if there is one."""

    def __init__(self, *, executor: Any = None) -> None:
        self._executor = executor
        self._lock = threading.Lock()
        self._done = self._cancelled = self._asked = False
        self._result: Any = None
        self._exception: Exception | None = None
        self._callbacks: list[Callable[[Any], Any]] = []
        self._watchers: list[Callable[[], object]] = []

    def __del__(self) -> None:
        if self._exception is not None and not self._asked:
            print(f"nobody asked for this exception of a {type(self).__name__}: {self._exception!r}", file=sys.stderr)

    def __await__(self) -> Generator["Future", None, Any]:
        while not self.done():
            yield self
        return self.result()

    def cancel(self) -> None:
        """Give up waiting for it, if it is not done."""
        self._finish(cancelled=True)

    def cancelled(self) -> bool:
        """Whether it was cancelled."""
        return self._cancelled

    def done(self) -> bool:
        """Whether it has a result or an exception, or was cancelled."""
        return self._done

    def result(self) -> Any:
        """The result; None while there is none. Raises the exception that stands for it."""
        if exception := self.exception():
            raise exception
        return self._result

    def exception(self) -> Exception | None:
        """The exception that stands for a result, or None."""
        self._asked = True
        return self._exception

    def set_result(self, result: Any) -> None:
        """It is done."""
        self._finish(result)

    def set_exception(self, exception: Exception) -> None:
        """It is done, and failed."""
        self._finish(exception=exception)

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        """Call `callback(future)` when it is done: in the executor, or at once where there is none."""
        with self._lock:
            if not self._done:
                self._callbacks.append(callback)
                return
        self._call(callback)

    def remove_done_callback(self, callback: Callable[[Any], Any]) -> int:
        """Do not call it any more; how often it would have been."""
        with self._lock:
            kept = [one for one in self._callbacks if one != callback]
            removed = len(self._callbacks) - len(kept)
            self._callbacks = kept
        return removed

    def watch(self, watcher: Callable[[], object]) -> None:
        """Call `watcher()`, which is quick, in whatever thread makes it done; at once if it is."""
        with self._lock:
            if not self._done:
                self._watchers.append(watcher)
                return
        watcher()

    def unwatch(self, watcher: Callable[[], object]) -> None:
        """End `watch`."""
        with self._lock:
            self._watchers = [one for one in self._watchers if one != watcher]

    def _set_executor(self, executor: Any) -> None:
        self._executor = executor

    def _finish(self, result: Any = None, exception: Exception | None = None, cancelled: bool = False) -> None:
        with self._lock:
            if self._done:
                return
            self._result, self._exception, self._cancelled, self._done = result, exception, cancelled, True
            callbacks, watchers, self._callbacks, self._watchers = self._callbacks, self._watchers, [], []
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
    """A function with its arguments, or a coroutine, that an executor runs; the future of what it returns."""

    def __init__(
        self,
        handler: Any,
        args: Any = None,
        kwargs: Any = None,
        executor: Any = None,
        again: Callable[["Task"], object] = lambda task: None,
    ) -> None:
        super().__init__(executor=executor)
        self._args, self._kwargs, self._again = args or (), kwargs or {}, again
        self._coroutine = handler if inspect.iscoroutine(handler) else None
        self._handler = handler
        self._running = threading.Lock()

    def __call__(self) -> None:
        """Run it, to its end or, if it is a coroutine, to its next await."""
        with self._running:  # what it awaited may be there before the thread that ran it last has left it
            if not self._done:
                self._step()

    def executing(self) -> bool:
        """Whether it runs now."""
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
            awaited.watch(lambda: self._again(self))
        else:
            self._again(self)


class Tasks:
    """Tasks that wait for an executor, in order."""

    def __init__(self, callback_group: CallbackGroup | None = None) -> None:
        self.callback_group = callback_group
        self._waiting: deque[Task] = deque()
        self._waker = Waker()

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Let a function or a coroutine wait for the executor."""
        task = Task(callback, args, kwargs, self, again=self._add)
        self._add(task)
        return task

    def take(self) -> Callable[[], None] | None:
        """The work of the oldest, or None. What it raises is raised by the work as well."""
        if not self._waiting:
            return None
        task = self._waiting.popleft()

        def work() -> None:
            task()
            if task.done():
                task.result()

        return work

    def arm(self, waker: Waker) -> None:
        """Wake `waker` for the next one."""
        self._waker = waker

    def _add(self, task: Task) -> None:
        self._waiting.append(task)
        self._waker.wake()
