"""Signals that end a process, and its exit."""

import _thread
import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import NoReturn

from holozen.console import drain, give_up_readers, report
from holozen.system import IS_LINUX

_PR_SET_PDEATHSIG = 1  # prctl(2)
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
POLL = 0.5  # s
INTERRUPTED = 130  # the exit code after Ctrl-C, as of shells


def stop_event() -> threading.Event:
    """An event that SIGINT, SIGTERM and SIGHUP set, and the death of a thread. `wait` on it instead
    of sleeping.
    """
    stop = threading.Event()
    threading.excepthook = _ThreadDeath(stop)

    def end(_number: int, _frame: FrameType | None) -> None:
        # Not set from here: the interrupted thread may be in `wait` and hold the event's lock.
        _thread.start_new_thread(stop.set, ())
        give_up_readers()

    for number in SIGNALS:
        signal.signal(number, end)
    return stop


class _ThreadDeath:
    """As threading.excepthook: sets `stop` when an exception ends a thread, and lets the process
    fail. Without that thread it would go on and look well, but do only a part of its work.
    """

    def __init__(self, stop: threading.Event) -> None:
        hook = threading.excepthook
        self._before: Callable[[threading.ExceptHookArgs], object]
        self._before = hook._before if isinstance(hook, _ThreadDeath) else hook
        self._stop = stop

    def __call__(self, args: "threading.ExceptHookArgs") -> None:
        self._before(args)
        name = args.thread.name if args.thread else "a thread"
        report(
            f"{name} ended by {args.exc_type.__name__}: {args.exc_value}; this process ends with it"
        )
        Ending.failed = True
        self._stop.set()


def wait_for_end(stop: threading.Event) -> None:
    """Wait until `stop` is set. It polls, since a signal just before a wait does not interrupt
    it.
    """
    while not stop.wait(POLL):
        pass


@contextlib.contextmanager
def deferred_interrupt() -> Iterator[None]:
    """Delay the KeyboardInterrupt of a Ctrl-C to the end of the block. For importing messages:
    during the import of msgspec it would be lost, or crash the process.
    """
    caught: list[int] = []
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda number, _frame: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if caught:
        raise KeyboardInterrupt


def interrupt_again(unraisable: "sys.UnraisableHookArgs") -> None:
    """As sys.unraisablehook: a Ctrl-C in a callback of the interpreter, such as each import has,
    would be lost. It interrupts what runs next.
    """
    if unraisable.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(unraisable)
    else:  # by another thread: from here, it would interrupt this function
        _thread.start_new_thread(os.kill, (os.getpid(), signal.SIGINT))


class Ending:
    """Ends a process that has opened Zenoh sessions: as Python does, but without finalizing the
    interpreter.

    Zenoh's own threads run on after its sessions are closed. One that enters Python while the
    interpreter is being finalized aborts the process, and one that uses statics that the C library
    has destroyed by then panics (eclipse-zenoh/zenoh#1904). So the last callback of atexit ends the
    process. Callbacks run in the reverse order of their registration: make the Ending before
    anything else registers one. `of_verb`: the process runs one `holozen VERB`, and ends with it.
    `failed`: a thread of it died, so that its exit code is not 0.
    """

    of_verb = failed = False

    def __init__(self, *, of_verb: bool = False) -> None:
        Ending.of_verb = of_verb
        self.code = 1  # of an uncaught exception
        self._before: Callable[[int, FrameType | None], object]
        atexit.register(self._end)

    def leave(self, code: int | str | None) -> NoReturn:
        """Exit, once all non-daemon threads and the callbacks of atexit are done. Ctrl-C ends that
        wait.
        """
        code = code or int(Ending.failed)
        self.code = code if isinstance(code, int) else int(code is not None)
        before = signal.getsignal(signal.SIGINT)
        if callable(before):
            self._before = before
            signal.signal(signal.SIGINT, self._interrupt)
        sys.exit(code)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self.code = self.code or INTERRUPTED
        with contextlib.suppress(KeyboardInterrupt):
            self._before(number, frame)
        self._end()

    def _end(self) -> None:
        if "zenoh" not in sys.modules:
            return
        drain()
        for stream in (sys.stdout, sys.stderr):
            # it is gone, closed or never existed
            with contextlib.suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(self.code)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Discard what code that is not Python's prints to stderr, and all else that is printed there.
    What was reported before is written first: its thread may not have run yet, on a busy machine.
    """
    drain()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


def dies_with_parent() -> Callable[[], None]:
    """For subprocess's `preexec_fn`: have the kernel end the child when the thread that started it
    ends, at the latest when this process is killed. macOS has nothing of the kind: there a killed
    parent leaves its children.
    """
    if not IS_LINUX:
        return lambda: None
    import ctypes

    libc = ctypes.CDLL(None)  # here, and not in the child: an import between fork and exec may hang
    return lambda: libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM) and None
