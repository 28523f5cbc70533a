"""Executors: they run the callbacks of their nodes. This is what they share; see executors.py."""

import inspect
import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Self

from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.context import Context, ExternalShutdownException, get_default_context
from holozen.ros.entity import Entity, Work
from holozen.ros.exceptions import RCLError
from holozen.ros.inbox import Waker
from holozen.ros.missing import Told
from holozen.ros.task import Future, Task, Tasks
from holozen.ros.timer import Timer

SHARED = 0.001  # s between two tries


class TimeoutException(Exception):
    """Nothing came in time."""


class ShutdownException(Exception):
    """The executor was shut down."""


class ConditionReachedException(Exception):
    """What was waited for has come."""


class Executor(Told):
    """Looks at the entities of its nodes in turn, one callback each. Subclasses say in which thread they run.

    Raises RCLError where the context was not begun or has ended, ExternalShutdownException after a signal.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        self._context = context or get_default_context()
        if not self._context.ok():
            self._context.check_running("make an executor")
            raise RCLError("failed to make an executor: rclpy is not running; call rclpy.init() first")
        self._nodes: list[Any] = []
        self._tasks = Tasks()
        self._waker = Waker()
        self._entities: tuple[Entity, ...] | None = None  # of all nodes; None where they have changed
        self._timers: list[Timer] = []
        self._turn = 0  # the next entity to look at
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
        """Run a function or a coroutine in spin. Its future is given at once."""
        return self._tasks.create_task(callback, *args, **kwargs)

    def add_node(self, node: Any) -> bool:
        """Run the callbacks of a node. False if it does already. The node leaves any other executor."""
        if node in self._nodes:
            return False
        self._nodes.append(node)
        node.executor = self
        self.changed()
        return True

    def remove_node(self, node: Any) -> None:
        """Run its callbacks no more."""
        if node in self._nodes:
            self._nodes.remove(node)
            if node.executor is self:
                node.executor = None
            self.changed()

    def get_nodes(self) -> list[Any]:
        """Its nodes."""
        return list(self._nodes)

    def wake(self) -> None:
        """Let the thread that spins look again."""
        self._waker.wake()

    def changed(self) -> None:
        """A node got or lost something."""
        self._entities = None
        self.wake()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Spin no more. Whether all callbacks have ended."""
        self._is_shutdown = True
        self.wake()
        for node in self.get_nodes():
            self.remove_node(node)
        return True

    def spin(self) -> None:
        """Run callbacks until rclpy or the executor is shut down. Raises ExternalShutdownException after a signal."""
        while self._context.ok() and not self._is_shutdown:
            self.spin_once()
        self._context.check_signal()  # it came between two waits

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Run callbacks until a future is done, at most so many seconds."""
        deadline = _deadline(timeout_sec)
        while self._context.ok() and not self._is_shutdown and not future.done():
            left = None if deadline is None else deadline - time.monotonic()
            self.spin_once_until_future_complete(future, None if left is None else max(left, 0.0))
            if left is not None and left <= 0:
                return
        if not future.done():
            self._context.check_signal()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run one callback. Waits for it, at most so many seconds (None: for ever, 0: not at all)."""
        self._spin_once(timeout_sec, _never)

    def wait_for_ready_callbacks(
        self, timeout_sec: float | None = None, nodes: Any = None, condition: Callable[[], bool] | None = None
    ) -> tuple[Callable[[], None], Entity, Any]:
        """(what runs the next callback, its subscription or timer or so, its node), for executors of a script's own.

        `nodes` does nothing. Raises TimeoutException, ShutdownException, and ConditionReachedException once
        `condition()` holds.
        """
        entity, work = self._wait_for_work(timeout_sec, condition or _never)
        owners = (node for node in self.get_nodes() if entity in node._holozen.entities())
        return partial(self._run, entity, work), entity, next(owners, None)

    def spin_once_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """`spin_once` that ends as well when a future is done."""
        future.watch(self._waker.wake)
        try:
            self._spin_once(timeout_sec, future.done)
        finally:
            future.unwatch(self._waker.wake)

    def _spin_once(self, timeout_sec: float | None, reached: Callable[[], bool]) -> None:
        try:
            entity, work = self._wait_for_work(timeout_sec, reached)
        except (ShutdownException, TimeoutException, ConditionReachedException):
            return
        self._execute(entity, work)

    def _execute(self, entity: Entity, work: Callable[[], Any]) -> None:
        raise NotImplementedError

    def _run(self, entity: Entity, work: Callable[[], Any]) -> None:
        """Run one callback. What it raises goes to whoever spins."""
        group, awaits = entity.callback_group, False
        try:
            result = work()
            awaits = inspect.iscoroutine(result)
            if awaits:
                self.create_task(self._to_its_end(group, result))
        finally:
            if group is not None and not awaits:
                group.ending_execution(entity)

    async def _to_its_end(self, group: CallbackGroup | None, coroutine: Any) -> None:
        """A callback that awaits keeps its group busy until its end."""
        try:
            await coroutine
        finally:
            if group is not None:
                group.ending_execution(None)
                self.wake()

    def _wait_for_work(self, timeout_sec: float | None, reached: Callable[[], bool]) -> Work:
        deadline = _deadline(timeout_sec)
        while True:
            self._check(reached)
            if found := self._next():
                return found
            left = None if deadline is None else deadline - time.monotonic()
            if left is not None and left <= 0:
                raise TimeoutException
            if found := self._block(left):
                return found

    def _check(self, reached: Callable[[], bool]) -> None:
        if self._is_shutdown:
            raise ShutdownException
        if not self._context.ok():
            raise ExternalShutdownException
        if reached():
            raise ConditionReachedException

    def _block(self, seconds: float | None) -> Work | None:
        """Wait until something may be there to do; the work if it came in the last moment."""
        self._waker.waiting = True
        try:
            for entity in self._all():
                entity.arm(self._waker)
            if found := self._next():
                return found
            # Who shuts down or finishes what is waited for from here on wakes this wait, even before it begins.
            self._waker.wait(_soonest([seconds, *(timer.wait_seconds() for timer in self._timers)]))
        finally:
            self._waker.waiting = False
        return None

    def _all(self) -> tuple[Entity, ...]:
        entities = self._entities
        if entities is None:
            # Set first: a node that changes meanwhile sets it back to None.
            found: list[Entity] = [self._tasks, *(one for node in self.get_nodes() for one in node._holozen.entities())]
            entities = self._entities = tuple(found)
            self._timers = [one for one in found if isinstance(one, Timer)]
        return entities

    def _next(self) -> Work | None:
        """The next callback that may run, of the entities in turn. Its group is busy from then on."""
        entities = self._all()
        for _ in entities:
            entity = entities[self._turn % len(entities)]
            self._turn = (self._turn + 1) % len(entities)
            group = entity.callback_group
            if group is not None and not group.can_execute(entity):
                continue
            work = entity.take()
            if work is not None:
                while group is not None and not group.beginning_execution(entity):
                    time.sleep(SHARED)  # another executor was faster, with a group that both have
                return entity, work
        return None


def _never() -> bool:
    return False


def _deadline(timeout_sec: float | None) -> float | None:
    """A timeout of None or below zero is none."""
    return None if timeout_sec is None or timeout_sec < 0 else time.monotonic() + timeout_sec


def _soonest(seconds: Iterable[float | None]) -> float | None:
    return min((one for one in seconds if one is not None), default=None)
