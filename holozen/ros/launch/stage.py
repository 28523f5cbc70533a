"""Follows a launch file: does what it says, in order, and looks after its processes until all have ended."""

import contextlib
import heapq
import selectors
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from itertools import count
from typing import Any

from holozen.ros.launch.context import LaunchContext, Program, Scope
from holozen.ros.launch.entity import Action, Entities, LaunchDescriptionEntity
from holozen.ros.launch.events import Event, Handler, ProcessExited, ProcessStarted, Shutdown
from holozen.ros.launch.process import Running
from holozen.ros.launch.text import LaunchError
from holozen.ros.traceback import users_own
from holozen.tell import say

LOOK = 0.05  # s
GRACE = ((signal.SIGINT, 1.0), (signal.SIGTERM, 0.5))  # s from each to the next, and to SIGKILL


class Again(Action):
    """Starts a process that has ended again."""

    def __init__(self, action: Action, program: Program) -> None:
        super().__init__()
        self.action, self.program = action, program

    def execute(self, context: LaunchContext) -> None:
        """Start it."""
        context.stage.start(self.action, self.program)


class Stage:
    """Processes, timers and handlers. Use it in `with`: its processes end with it."""

    def __init__(self, flags: Sequence[str], stop: threading.Event) -> None:
        self.context = LaunchContext(self, flags)
        self._stop, self._stopping, self.failed = stop, False, False
        self.begun: Callable[[], None] = lambda: None  # what is called once all is done that waits for nothing
        self._queue: deque[tuple[Scope, LaunchDescriptionEntity]] = deque()
        self._later: list[tuple[Scope, Action]] = []  # what waits until all else was done
        self._delayed: set[int] = set()
        self._timers: list[tuple[float, int, Scope, Entities]] = []
        self._timer_numbers = count()
        self._handlers: list[tuple[Scope, Handler]] = []
        self._running: list[Running] = []
        self._numbers, self._selector = count(1), selectors.DefaultSelector()

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *_error: object) -> None:
        self._end()
        self._selector.close()
        for path in self.context.made:
            path.unlink(missing_ok=True)

    def run(self, entities: Entities) -> bool:
        """Do what the entities say, and wait until all processes have ended or the launch is stopped.

        Whether all went well. Raises LaunchError, and what the launch file's own functions raise.
        """
        self._first(self.context.scope, entities)
        self._work()
        self.begun()
        while not self._stopping and (self._running or self._timers):
            if self._stop.is_set():
                self.stop("")
                break
            self._look()
            self._work()
        self._tell(Shutdown())
        self._work()
        return not self.failed

    @property
    def pending(self) -> list[Any]:
        """What may be done later: when processes start or end, and when timers are due."""
        later = [getattr(running.action, "on_exit", None) for running in self._running]
        return [*later, *(handler.actions for _, handler in self._handlers), *(timer[3] for timer in self._timers)]

    def start(self, action: Action, program: Program) -> None:
        """Start a process. Raises LaunchError."""
        if self._stopping:
            return
        running = Running(action, program, f"{program.name}-{next(self._numbers)}", self._stop.is_set)
        self._running.append(running)
        for pipe in running.pipes:
            self._selector.register(pipe.source, selectors.EVENT_READ, pipe)
        self._tell(ProcessStarted(action, running.name))

    def left_out(self, action: Action, ends: bool) -> None:
        """Go on as if the process had been started, and had ended if it would."""
        self._tell(ProcessStarted(action, ""))
        if ends:
            self._tell(ProcessExited(action, "", 0))

    def after(self, seconds: float, actions: Entities) -> object:
        """Do actions later; what to `cancel`."""
        number = next(self._timer_numbers)
        heapq.heappush(self._timers, (time.monotonic() + seconds, number, self.context.scope, actions))
        return number

    def cancel(self, timer: object) -> None:
        """Do those never."""
        self._timers = [each for each in self._timers if each[1] != timer]
        heapq.heapify(self._timers)

    def last(self, action: Action) -> bool:
        """Do an action again when all else was done; False if that is now."""
        if id(action) in self._delayed:
            return False
        self._delayed.add(id(action))
        self._later.append((self.context.scope, action))
        return True

    def handle(self, handler: Any) -> None:
        """Have something done when something happens. Raises LaunchError."""
        if not isinstance(handler, Handler):
            raise LaunchError(
                f"{handler!r:.80} is no event handler; there are OnProcessExit, OnProcessStart, OnShutdown"
            )
        self._handlers.append((self.context.scope, handler))

    def unhandle(self, handler: Any) -> None:
        """Have it done no more."""
        self._handlers = [each for each in self._handlers if each[1] is not handler]

    def stop(self, reason: str) -> None:
        """End the launch."""
        if reason and not self._stopping:
            say(f"launch: ends: {reason}")
        self._stopping = True

    def _first(self, scope: Scope, entities: Iterable[LaunchDescriptionEntity]) -> None:
        self._queue.extendleft((scope, entity) for entity in reversed(list(entities)))

    def _work(self) -> None:
        """Do all that waits."""
        while self._queue or self._later:
            if not self._queue:
                self._queue.extend(self._later)
                self._later.clear()
            self.context.scope, entity = self._queue.popleft()
            try:
                found = entity.visit(self.context)
            except LaunchError as error:
                raise error.at(entity.place) from None
            except (TypeError, ValueError, AttributeError) as error:
                if users_own(error.__traceback__):  # an error of the launch file's own function
                    raise
                raise LaunchError(f"{type(entity).__name__}: {error}", entity.place) from None
            self._first(self.context.scope, found)

    def _look(self) -> None:
        """Pass on what was written, and see which processes have ended and which timers are due."""
        for key, _ in self._selector.select(self._wait()):
            if not key.data.read():
                self._selector.unregister(key.fileobj)
        for running in [each for each in self._running if each.has_ended]:
            self._ended(running)
        while self._timers and self._timers[0][0] <= time.monotonic():
            _, _, scope, actions = heapq.heappop(self._timers)
            self._queue.extend((scope, action) for action in actions)

    def _wait(self) -> float:
        due = self._timers[0][0] - time.monotonic() if self._timers else LOOK
        return max(0.0, min(LOOK, due))

    def _ended(self, running: Running) -> None:
        code, program = self._close(running), running.program
        if code > 0:
            say(f"launch: {running.name} failed with exit code {code}")
        elif code < 0:
            say(f"launch: {running.name} was ended by {_signal(-code)}")
        self.failed = self.failed or code != 0
        self._tell(ProcessExited(running.action, running.name, code))
        on_exit = getattr(running.action, "on_exit", None)
        if on_exit is not None:
            handler = Handler(None, on_exit)
            handler.event = ProcessExited
            self._first(
                self.context.scope, handler.answer(ProcessExited(running.action, running.name, code), self.context)
            )
        if program.required:
            self.stop(f"{running.name} has ended, and nothing here goes on without it")
        elif program.respawn is not None:
            self.after(program.respawn, [Again(running.action, program)])

    def _close(self, running: Running) -> int:
        self._running.remove(running)
        for pipe in running.pipes:
            with contextlib.suppress(KeyError):
                self._selector.unregister(pipe.source)
        return running.finish()

    def _tell(self, event: Event) -> None:
        """Do what the launch file wants to be done about an event, after what waits already."""
        for scope, handler in list(self._handlers):
            self._queue.extend((scope, entity) for entity in handler.answer(event, self.context))

    def _end(self) -> None:
        """End all processes: kindly, then firmly."""
        for number, grace in GRACE:
            for running in self._running:
                running.signal(number)
            deadline = time.monotonic() + grace
            while self._running and time.monotonic() < deadline:
                self._drain(deadline)
        for running in list(self._running):
            running.signal(signal.SIGKILL)
            say(f"launch: {running.name} did not end and was killed")
            self._close(running)

    def _drain(self, deadline: float) -> None:
        for key, _ in self._selector.select(min(LOOK, max(0.0, deadline - time.monotonic()))):
            if not key.data.read():
                self._selector.unregister(key.fileobj)
        for running in [each for each in self._running if each.has_ended]:
            running.signal(signal.SIGTERM)  # what it has started and left
            self._close(running)


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
