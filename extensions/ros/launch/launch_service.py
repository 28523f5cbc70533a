"""Executes a launch file in order, and supervises its processes until all have ended."""

import contextlib
import os
import sched
import select
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import count
from pathlib import Path
from typing import IO, Any

from holozen.console import Failure, discard, report
from holozen.process import SIGNALS, dies_with_parent, stop_event
from holozen.ros.launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
)
from holozen.ros.launch.event_handlers import (
    Event,
    EventHandler,
    ProcessExited,
    ProcessStarted,
    Shutdown,
)
from holozen.ros.launch.launch_context import (
    LaunchContext,
    LaunchError,
    Program,
    Scope,
    describe,
    here,
)
from holozen.ros.launch.launch_description import Action, Entities, LaunchDescriptionEntity, checked
from holozen.ros.launch.substitutions import LaunchConfiguration
from holozen.ros.rclpy import context as rclpy_context
from holozen.ros.tracebacks import user_frames
from holozen.suspension import suspend_children_too
from holozen.transport.connection import Connection

POLL = 0.05  # s
GRACE = ((signal.SIGINT, 1.0), (signal.SIGTERM, 0.5))  # s until the next signal, and to SIGKILL

CHUNK = 65536  # bytes
# the first lines of a traceback; the others are indented, but for its last one
TRACEBACK = (
    b"Fatal Python error: ",
    b"Python runtime state: ",
    b"Traceback (most recent call last)",
)
LONGEST_LINE = 1_000_000  # bytes that are kept until the end of a line arrives

# stands for arguments that are known only when a function or an included file is executed
ANY = "*"


class Supervisor:
    """Runs processes, timers and event handlers. Use it in `with`: its processes end with the
    block.
    """

    def __init__(self, flags: Sequence[str], stop: threading.Event) -> None:
        self.context = LaunchContext(self, flags)
        self._stop, self._stopping, self.failed = stop, False, False
        self._reason = "idle"  # as ROS calls the end of a launch in which nothing is left to do
        # called once everything is done that waits for nothing
        self.on_started: Callable[[], None] = lambda: None
        self._queue: deque[tuple[Scope, LaunchDescriptionEntity]] = deque()
        self._later: list[tuple[Scope, Action]] = []  # executed after everything else
        self._postponed: set[int] = set()
        self._timers = sched.scheduler(time.monotonic)  # queue scopes and their actions
        self._handlers: list[tuple[Scope, EventHandler]] = []
        self._processes: list[Process] = []
        # until all is executed: an error then starts none of them
        self._held: list[tuple[Action, Program]] | None = []
        self._lacking: list[tuple[Action, str, str]] = []  # likewise
        self._numbers, self._selector = count(1), selectors.DefaultSelector()

    def __enter__(self) -> "Supervisor":
        return self

    def __exit__(self, *_error: object) -> None:
        self._end()
        self._selector.close()
        for path in self.context.temporary_files:
            path.unlink(missing_ok=True)

    def run(self, entities: Entities) -> bool:
        """Execute the entities, and wait until all processes have ended or the launch is stopped.

        Returns whether all succeeded. Raises LaunchError, and what functions of the launch file
        raise.
        """
        self._queue_first(self.context.scope, entities)
        self._execute()
        self._start_held()
        self.on_started()
        while not self._stopping and (self._processes or self._timers.queue):
            if self._stop.is_set():
                self.stop("")
                break
            self._wait()
            self._execute()
        self._emit(Shutdown(reason=self._reason))
        self._execute()
        return not self.failed

    def pending_arguments(self) -> set[str]:
        """The launch arguments that event handlers and timers may use later; with ANY if that is
        not known.
        """
        later = [getattr(process.action, "on_exit", None) for process in self._processes]
        later += [handler.actions for _, handler in self._handlers]
        later += [action for timer in self._timers.queue for _, action in timer.argument[0]]
        return set(_arguments(later, set()))

    def start(self, action: Action, program: Program) -> None:
        """Start a process. Raises LaunchError."""
        if self._stopping:
            return
        if self._held is not None:
            self._held.append((action, program))
            return
        process = Process(
            action, program, f"{program.name}-{next(self._numbers)}", self._stop.is_set
        )
        self._processes.append(process)
        for pipe in process.pipes:
            self._selector.register(pipe.source, selectors.EVENT_READ, pipe)
        self._emit(ProcessStarted(action, process.name))

    def _start_held(self) -> None:
        for lacking in self._lacking:
            self._leave_out(*lacking)
        held, self._held = self._held or [], None
        for action, program in held:
            try:
                self.start(action, program)
            except LaunchError as error:
                raise LaunchError.of(error, action.place) from None
        self._execute()

    def skip(self, action: Action, ends: bool) -> None:
        """Go on as if the process had started and, if it `ends`, had ended."""
        self._emit(ProcessStarted(action, ""))
        if ends:
            self._emit(ProcessExited(action, "", 0))

    def lack(self, action: Action, name: str, why: str) -> None:
        """Go on without a node whose work nothing here does, if there is a sim. Raises LaunchError
        if there is none.
        """
        if self._held is None:
            self._leave_out(action, name, why)
        else:  # the sim may come later in the launch file
            self._lacking.append((action, name, why))

    def _leave_out(self, action: Action, name: str, why: str) -> None:
        if not self.context.simulates and not self.context.other_sim():
            raise LaunchError(
                f"{name} cannot run here: {why}; only a simulation goes on without it", action.place
            )
        report(f"launch: {name} is left out: {why}")

    def after(self, seconds: float, actions: Sequence[LaunchDescriptionEntity]) -> sched.Event:
        """Execute actions later. Returns the timer for `cancel`."""
        queued = [(self.context.scope, action) for action in actions]
        return self._timers.enter(seconds, 0, self._queue.extend, (queued,))

    def cancel(self, timer: Any) -> None:
        """Cancel a timer, unless it is over."""
        with contextlib.suppress(ValueError):
            self._timers.cancel(timer)

    def postpone(self, action: Action) -> bool:
        """Execute an action again after everything else. Returns False if it was postponed
        before.
        """
        if id(action) in self._postponed:
            return False
        self._postponed.add(id(action))
        self._later.append((self.context.scope, action))
        return True

    def register(self, handler: Any) -> None:
        """Register an event handler. Raises LaunchError."""
        if not isinstance(handler, EventHandler):
            raise LaunchError(
                f"{handler!r:.80} is not an event handler; use OnProcessExit, OnProcessStart or "
                "OnShutdown"
            )
        self._handlers.append((self.context.scope, handler))

    def unregister(self, handler: Any) -> None:
        """Remove an event handler."""
        self._handlers = [each for each in self._handlers if each[1] is not handler]

    def stop(self, reason: str) -> None:
        """End the launch; an empty `reason` stands for a signal."""
        if not self._stopping:
            self._stopping, self._reason = True, reason or "a signal"
            if reason:
                report(f"launch: ending: {reason}")

    def _queue_first(self, scope: Scope, entities: Iterable[LaunchDescriptionEntity]) -> None:
        self._queue.extendleft((scope, entity) for entity in reversed(list(entities)))

    def _execute(self) -> None:
        """Execute everything that is queued."""
        while self._queue or self._later:
            if not self._queue:
                self._queue.extend(self._later)
                self._later.clear()
            self.context.scope, entity = self._queue.popleft()
            try:
                found = entity.visit(self.context)
            except Failure as error:
                raise LaunchError.of(error, entity.place) from None
            except (TypeError, ValueError, AttributeError) as error:
                if user_frames(error.__traceback__):  # raised by a function of the launch file
                    raise
                raise LaunchError(f"{type(entity).__name__}: {error}", entity.place) from None
            self._queue_first(self.context.scope, found)

    def _wait(self) -> None:
        """Forward output, and look which processes have ended and which timers are due."""
        due = self._timers.queue[0].time - time.monotonic() if self._timers.queue else POLL
        self._forward(max(0.0, min(POLL, due)))
        for process in [each for each in self._processes if each.has_ended]:
            self._ended(process)
        self._timers.run(blocking=False)

    def _forward(self, seconds: float) -> None:
        for key, _ in self._selector.select(seconds):
            if not key.data.read():
                self._selector.unregister(key.fileobj)

    def _ended(self, process: "Process") -> None:
        code, program = self._close(process), process.program
        if code > 0:
            report(f"launch: {process.name} failed with exit code {code}")
        elif code < 0:
            report(f"launch: {process.name} was ended by {_signal_name(-code)}")
        self.failed = self.failed or code != 0
        event = ProcessExited(process.action, process.name, code)
        self._emit(event)
        on_exit = getattr(process.action, "on_exit", None)
        if on_exit is not None:
            handler = EventHandler(None, on_exit)
            handler.event = ProcessExited
            self._queue_first(self.context.scope, handler.handle(event, self.context))
        if program.required:
            self.stop(f"{process.name} has ended, and everything here depends on it")
        elif program.respawn is not None:
            self.after(
                program.respawn,
                [OpaqueFunction(function=lambda _: self.start(process.action, program))],
            )

    def _close(self, process: "Process") -> int:
        self._processes.remove(process)
        for pipe in process.pipes:
            with contextlib.suppress(KeyError):
                self._selector.unregister(pipe.source)
        return process.finish()

    def _emit(self, event: Event) -> None:
        """Queue the actions of the event handlers, after everything that is queued already."""
        for scope, handler in list(self._handlers):
            self._queue.extend((scope, entity) for entity in handler.handle(event, self.context))

    def _end(self) -> None:
        """End all processes, with stronger signals one after the other."""
        for number, grace in GRACE:
            for process in self._processes:
                process.signal(number)
            deadline = time.monotonic() + grace
            while self._processes and time.monotonic() < deadline:
                self._forward(min(POLL, max(0.0, deadline - time.monotonic())))
                for process in [each for each in self._processes if each.has_ended]:
                    process.signal(signal.SIGTERM)  # for processes that it has started and left
                    self._close(process)
        for process in list(self._processes):
            process.signal(signal.SIGKILL)
            report(f"launch: {process.name} did not end and was killed")
            self._close(process)


class LaunchService:
    """Runs launch descriptions from within a script."""

    def __init__(
        self,
        *,
        argv: Iterable[str] | None = None,
        noninteractive: bool = False,
        debug: bool = False,
    ) -> None:
        self._argv, self._entities, self._has_ended = (
            list(argv or ()),
            list[LaunchDescriptionEntity](),
            False,
        )
        self._stop: threading.Event | None = None

    def include_launch_description(self, launch_description: Any) -> None:
        """Add a description. Raises LaunchError for anything else."""
        self._entities += checked(launch_description, here())

    def run(self, *, shutdown_when_idle: bool = True) -> int:
        """Execute the descriptions until all processes have ended, or a signal or `shutdown` ends
        them. Returns the exit code. An error in a description is one line and code 1; what its
        functions raise passes.
        """
        with _ended_by_signals() as self._stop:
            if self._has_ended:
                self._stop.set()
            where = rclpy_context.connection
            with Supervisor(where.arguments(), self._stop) as supervisor:
                context = supervisor.context
                context.argv, context.other_sim = self._argv, partial(running_sim, where)
                context.scope = context.scope.within(Path(sys.argv[0]).absolute())
                try:
                    return 0 if supervisor.run(self._entities) else 1
                except LaunchError as error:
                    report(f"launch: {error}")
                    return 1

    def shutdown(self) -> None:
        """End the launch, from a callback or another thread."""
        self._has_ended = True
        if self._stop:
            self._stop.set()


@contextlib.contextmanager
def _ended_by_signals() -> Iterator[threading.Event]:
    """An event that signals set, in a script whose own handlers are in force again afterwards."""
    if threading.current_thread() is not threading.main_thread():
        yield threading.Event()
        return
    before = {number: signal.getsignal(number) for number in (*SIGNALS, signal.SIGTSTP)}
    suspend_children_too()
    try:
        yield stop_event()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def running_sim(where: Connection) -> str:
    """The source of a sim that runs already; empty if there is none."""
    from holozen.transport.bus import Bus
    from holozen.transport.graph import on_key

    with Bus("launch", where) as bus:
        return next((end.source for end in on_key(bus.endpoints(), "clock", "pub")), "")


class Process:
    """A process whose output is forwarded line by line, after its name.

    It leads a process group of its own, so no key of the terminal reaches it. Once `drops_output()`
    is true, output that is not read by anyone is dropped.
    """

    def __init__(
        self, action: Action, program: Program, name: str, drops_output: Callable[[], bool]
    ) -> None:
        self.action, self.program, self.name = action, program, name
        words = program.words[0] if program.shell else list(program.words)
        try:
            self._popen = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                cwd=program.cwd,
                # lines arrive when they are written
                env={**program.environment, "PYTHONUNBUFFERED": "1"},
                shell=program.shell,
                start_new_session=True,
                preexec_fn=dies_with_parent(),
            )
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", "") or error
            raise LaunchError(
                f"cannot start {program.words[0]!r:.200}: {reason}", action.place
            ) from None
        streams = ((self._popen.stdout, sys.stdout), (self._popen.stderr, sys.stderr))
        self.pipes = [
            Pipe(name, source, sink, drops_output) for source, sink in streams if source is not None
        ]

    @property
    def has_ended(self) -> bool:
        """Whether it has ended. Its process id is not reused before `finish`."""
        if self._popen.returncode is not None:
            return True
        return (
            os.waitid(os.P_PID, self._popen.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
        )

    def signal(self, number: int) -> None:
        """Send a signal to its process group, whose tracebacks of that are not forwarded."""
        for pipe in self.pipes:
            pipe.is_interrupted = True
        if self._popen.returncode is None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._popen.pid, number)

    def finish(self) -> int:
        """Forward the remaining output, and close; the exit code, -N after signal N."""
        code = self._popen.wait()
        for pipe in self.pipes:
            while pipe.read():
                pass
            pipe.close()
        return code


class Pipe:
    """One output stream of a process, and where it is forwarded.

    Attributes:
        is_interrupted: Whether the process was sent a signal. From then on a traceback that ends in
            KeyboardInterrupt is dropped: that is how a Python ends that was still loading.
    """

    def __init__(
        self, name: str, source: IO[bytes], sink: IO[str], drops_output: Callable[[], bool]
    ) -> None:
        self.source, self._sink, self._prefix = source, sink, f"[{name}] ".encode()
        self._drops_output = drops_output
        self._rest = b""
        self.is_interrupted = False
        self._traceback: list[bytes] = []  # its lines so far, while one comes after a signal
        os.set_blocking(source.fileno(), False)

    def read(self) -> bool:
        """Forward the available lines. Returns whether there may be more."""
        try:
            data = os.read(self.source.fileno(), CHUNK)
        except BlockingIOError:
            return False
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST_LINE or not data:
            lines, self._rest = [*lines, *([self._rest] if self._rest else [])], b""
        self._write(lines)
        return bool(data)

    def close(self) -> None:
        """Forward an incomplete last line, or traceback, and close."""
        self._write([self._rest] if self._rest else [])
        self.is_interrupted, held = False, self._traceback
        self._write(held)
        self._rest, self._traceback = b"", []
        self.source.close()

    def _write(self, lines: list[bytes]) -> None:
        if self.is_interrupted:
            lines = [*self._without_interrupts(lines)]
        if lines:
            self._sink.flush()
            text = b"".join(self._prefix + line + b"\n" for line in lines)
            _write_all(self._sink, text, self._drops_output)

    def _without_interrupts(self, lines: list[bytes]) -> Iterator[bytes]:
        """The lines without those of tracebacks that end in KeyboardInterrupt."""
        for line in lines:
            if not self._traceback and not line.startswith(TRACEBACK):
                yield line
                continue
            self._traceback.append(line)
            if line.startswith(b"KeyboardInterrupt"):
                self._traceback.clear()
            elif line[:1].strip() and not line.startswith(TRACEBACK):  # its last line
                yield from self._traceback
                self._traceback.clear()


def _write_all(sink: IO[str], text: bytes, drops_output: Callable[[], bool]) -> None:
    """Write all of a text, or what is read until `drops_output`: blocking here would keep processes
    from ending. The launch goes on if the reader, such as head, has gone.
    """
    try:
        number = sink.fileno()
    except (OSError, ValueError):  # not a file
        sink.write(text.decode(errors="replace"))
        return
    while text:
        if select.select([], [number], [], POLL)[1]:
            try:
                text = text[os.write(number, text[: select.PIPE_BUF]) :]  # as much as surely fits
            except BrokenPipeError:
                discard(number)
        elif drops_output():
            return


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _arguments(thing: Any, seen: set[int]) -> Iterator[str]:
    """The launch arguments in actions and substitutions, and in lists and dicts of them; ANY for
    functions and included files. `seen` are the ids of those that were visited.
    """
    if id(thing) in seen or isinstance(thing, str):
        return
    seen.add(id(thing))
    if callable(thing) or isinstance(thing, OpaqueFunction | IncludeLaunchDescription):
        yield ANY
    elif isinstance(thing, LaunchConfiguration):
        yield describe(thing.variable_name)
    elif isinstance(thing, DeclareLaunchArgument):
        yield thing.name
    for part in _parts(thing):
        yield from _arguments(part, seen)


def _parts(thing: Any) -> list[Any]:
    if isinstance(thing, dict):
        return [*thing, *thing.values()]
    if isinstance(thing, list | tuple | set):
        return list(thing)
    if not type(thing).__module__.startswith("holozen.ros.launch"):
        return []
    return [
        part for name, part in getattr(thing, "__dict__", {}).items() if not name.startswith("_")
    ]
