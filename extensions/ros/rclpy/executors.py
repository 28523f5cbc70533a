"""Executors, which run the callbacks of nodes: in the spinning thread, or in several."""

import inspect
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import Any, Self

from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.context import Context, ExternalShutdownException, get_default_context
from holozen.ros.rclpy.exceptions import RCLError
from holozen.ros.rclpy.logging import get_logger
from holozen.ros.rclpy.task import Future, Task, TaskQueue
from holozen.ros.rclpy.timer import Timer
from holozen.ros.rclpy.waitable import LATE, Waitable, Waker, Work, deadline
from holozen.suggest import shorten

__all__ = [
    "ConditionReachedException",
    "Executor",
    "MultiThreadedExecutor",
    "ShutdownException",
    "SingleThreadedExecutor",
    "TimeoutException",
]

RETRY = 0.001  # s before a callback group that another executor uses is tried again


class TimeoutException(Exception):
    """Nothing became ready in time."""


class ShutdownException(Exception):
    """The executor was shut down."""


class ConditionReachedException(Exception):
    """The condition of `wait_for_ready_callbacks` holds."""


class Executor(HelpfulAttributes):
    """Looks at the subscriptions, timers and so on of its nodes in turn. Subclasses choose the
    thread of a callback.

    Raises RCLError if the context is not initialized or was shut down, ExternalShutdownException
    after a signal.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        self._context = context or get_default_context()
        if not self._context.ok():
            self._context.check_running("create an executor")
            raise RCLError(
                "failed to create an executor: rclpy is not running; call rclpy.init() first"
            )
        self._nodes: list[Any] = []
        self._tasks = TaskQueue()
        self.waker = Waker()
        self._waitables: tuple[Waitable, ...] | None = None  # of all nodes; None after a change
        self._timers: list[Timer] = []
        self._turn = 0  # the index of the next waitable to look at
        # When the callback began that now runs in the spinning thread, and may spin itself; None if
        # there is none, or it was warned of.
        self._began: float | None = None
        self._is_shutdown = False
        self._context.on_shutdown(self.wake)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.shutdown()

    @property
    def context(self) -> Context:
        """The context it works in."""
        return self._context

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Run a function or a coroutine in spin. Returns its future, at once."""
        return self._tasks.create_task(callback, *args, **kwargs)

    def add_node(self, node: Any) -> bool:
        """Run the callbacks of a node, which leaves any other executor. False if it was added
        before. Raises TypeError for what is no node.
        """
        if isinstance(node, type) or not hasattr(node, "executor"):
            name, given = (
                (node.__name__, "the class")
                if isinstance(node, type)
                else ("MyNode", shorten(repr(node)))
            )
            raise TypeError(f"pass a node, such as {name}(), not {given}")
        if node in self._nodes:
            return False
        self._nodes.append(node)
        node.executor = self
        self.changed()
        return True

    def remove_node(self, node: Any) -> None:
        """Stop running the callbacks of a node."""
        if node in self._nodes:
            self._nodes.remove(node)
            if node.executor is self:
                node.executor = None
            self.changed()

    def get_nodes(self) -> list[Any]:
        """Its nodes."""
        return list(self._nodes)

    def wake(self) -> None:
        """Make the spinning thread look again."""
        self.waker.wake()

    def changed(self) -> None:
        """A node created or destroyed something."""
        self._waitables = None
        self.wake()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop spinning. Whether all callbacks have ended."""
        self._is_shutdown = True
        self.wake()
        for node in self.get_nodes():
            self.remove_node(node)
        return True

    def spin(self) -> None:
        """Run callbacks until rclpy or the executor is shut down. Raises ExternalShutdownException
        after a signal.
        """
        while self._context.ok() and not self._is_shutdown:
            self.spin_once()
        self._context.check_signal()  # it may have arrived between two waits

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until a future is done, at most `timeout_sec` seconds."""
        end = deadline(timeout_sec)
        while self._context.ok() and not self._is_shutdown and not future.done():
            left = end - time.monotonic()
            self.spin_once_until_future_complete(future, max(left, 0.0))
            if left <= 0:
                return
        if not future.done():
            self._context.check_signal()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback. Waits for it at most `timeout_sec` seconds (None: for ever, 0: not at
        all).
        """
        self._spin_once(timeout_sec, _never)

    def wait_for_ready_callbacks(
        self,
        timeout_sec: float | None = None,
        nodes: Any = None,
        condition: Callable[[], bool] | None = None,
    ) -> tuple[Callable[[], None], Waitable, Any]:
        """(a function that runs the next callback, its subscription or timer and so on, its node).

        For executors that a script defines. `nodes` is ignored. Raises TimeoutException,
        ShutdownException, and ConditionReachedException once `condition()` is true.
        """
        waitable, work = self._wait_for_work(timeout_sec, condition or _never)
        owners = (node for node in self.get_nodes() if waitable in node._holozen.entities())
        return partial(self._run, waitable, work), waitable, next(owners, None)

    def spin_once_until_future_complete(
        self, future: Future, timeout_sec: float | None = None
    ) -> None:
        """`spin_once`, which also returns when a future is done."""
        future.watch(self.waker.wake)
        try:
            self._spin_once(timeout_sec, future.done)
        finally:
            future.unwatch(self.waker.wake)

    def _spin_once(self, timeout_sec: float | None, condition: Callable[[], bool]) -> None:
        try:
            waitable, work = self._wait_for_work(timeout_sec, condition)
        except (ShutdownException, TimeoutException, ConditionReachedException):
            return
        self._execute(waitable, work)

    def _execute(self, waitable: Waitable, work: Callable[[], Any]) -> None:
        raise NotImplementedError

    def _run(self, waitable: Waitable, work: Callable[[], Any]) -> None:
        """Run one callback. Its exception propagates out of spin."""
        group, is_coroutine = waitable.callback_group, False
        try:
            result = work()
            is_coroutine = inspect.iscoroutine(result)
            if is_coroutine:
                self.create_task(self._await(group, result))
        finally:
            if group is not None and not is_coroutine:
                group.ending_execution(waitable)

    async def _await(self, group: CallbackGroup | None, coroutine: Any) -> None:
        """A callback that awaits keeps its group busy until it has ended."""
        try:
            await coroutine
        finally:
            if group is not None:
                group.ending_execution(None)
                self.wake()

    def _wait_for_work(self, timeout_sec: float | None, condition: Callable[[], bool]) -> Work:
        end = deadline(timeout_sec)
        while True:
            self._check(condition)
            if found := self._next():
                return found
            left = end - time.monotonic()
            if left <= 0:
                raise TimeoutException
            if found := self._block(left):
                return found

    def _check(self, condition: Callable[[], bool]) -> None:
        if self._is_shutdown:
            raise ShutdownException
        if not self._context.ok():
            raise ExternalShutdownException
        if condition():
            raise ConditionReachedException

    def _block(self, seconds: float) -> Work | None:
        """Wait until there may be work; the work if it arrived at the last moment."""
        self._warn_of_spin_in_callback()
        self.waker.waiting = True
        try:
            for waitable in self._all():
                waitable.arm(self.waker)
            if found := self._next():
                return found
            # From here on a shutdown, or a future that is done, wakes this wait even before it
            # begins.
            waits = [seconds, *(timer.wait_seconds() for timer in self._timers)]
            if self._began is not None:
                waits.append(LATE)
            self.waker.wait(min(wait for wait in waits if wait is not None))
        finally:
            self.waker.waiting = False
        return None

    def _warn_of_spin_in_callback(self) -> None:
        """Once a callback has spun for long: what it waits for may be a callback of its own
        group.
        """
        if self._began is not None and time.monotonic() - self._began > LATE:
            self._began = None
            groups = [
                each.callback_group for each in self._all() if each.callback_group is not None
            ]
            if not all(group.can_execute(None) for group in groups):
                get_logger("rclpy").warning(
                    "a callback spins its node: other callbacks of its group wait until it has "
                    "ended; use a"
                    " ReentrantCallbackGroup, or add_done_callback of the future"
                )

    def _all(self) -> tuple[Waitable, ...]:
        waitables = self._waitables
        if waitables is None:
            # Set before it is used: a node that changes in between resets it to None.
            found: list[Waitable] = [self._tasks]
            found += [one for node in self.get_nodes() for one in node._holozen.entities()]
            waitables = self._waitables = tuple(found)
            self._timers = [one for one in found if isinstance(one, Timer)]
        return waitables

    def _next(self) -> Work | None:
        """The next callback that may run, from the waitables in turn. Its group is busy from then
        on.
        """
        waitables = self._all()
        for _ in waitables:
            waitable = waitables[self._turn % len(waitables)]
            self._turn = (self._turn + 1) % len(waitables)
            group = waitable.callback_group
            if group is not None and not group.can_execute(waitable):
                continue
            work = waitable.take()
            if work is not None:
                while group is not None and not group.beginning_execution(waitable):
                    time.sleep(RETRY)  # another executor, which shares the group, was faster
                return waitable, work
        return None


class SingleThreadedExecutor(Executor):
    """Runs callbacks in the spinning thread, one after the other."""

    def _execute(self, waitable: Waitable, work: Callable[[], Any]) -> None:
        outer, self._began = self._began, time.monotonic()
        try:
            self._run(waitable, work)
        finally:
            self._began = outer


class MultiThreadedExecutor(Executor):
    """Runs callbacks in `num_threads` threads (by default one per processor, at least two).

    Callback groups determine which of them run at the same time; within a node's default group none
    do.
    """

    def __init__(self, num_threads: int | None = None, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._most = max(2, os.cpu_count() or 2) if num_threads is None else num_threads
        if self._most < 1:
            raise ValueError(f"num_threads is {num_threads}; use 1 or more")
        self._work: SimpleQueue[Work | None] = SimpleQueue()  # None ends a thread
        self._threads: list[threading.Thread] = []
        self._busy = 0
        self._lock = threading.Lock()
        self._errors: deque[BaseException] = deque()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop spinning, and wait for the running callbacks. Returns whether they have ended in
        time.
        """
        super().shutdown()
        deadline = None if timeout_sec is None else time.monotonic() + timeout_sec
        for _ in self._threads:
            self._work.put(None)
        others = [thread for thread in self._threads if thread is not threading.current_thread()]
        for thread in others:
            thread.join(None if deadline is None else max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in others)

    def _next(self) -> Work | None:
        # While all threads are busy, messages wait in their own queues, which keep the newest.
        return None if self._busy >= self._most else super()._next()

    def _check(self, condition: Callable[[], bool]) -> None:
        if self._errors:
            raise self._errors.popleft()
        super()._check(condition)

    def _execute(self, waitable: Waitable, work: Callable[[], Any]) -> None:
        with self._lock:
            self._busy += 1
        if self._busy > len(self._threads):
            thread = threading.Thread(target=self._serve, daemon=True)
            self._threads.append(thread)
            thread.start()
        self._work.put((waitable, work))

    def _serve(self) -> None:
        while work := self._work.get():
            try:
                self._run(*work)
            except BaseException as error:  # raised again in the spinning thread
                self._errors.append(error)
            with self._lock:
                self._busy -= 1
            self.wake()


def _never() -> bool:
    return False
