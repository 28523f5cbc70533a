"""What processes share: how they are told to end, and how they do."""

import _thread
import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import NoReturn

_PR_SET_PDEATHSIG = 1  # prctl(2)
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOOK = 0.5  # s
INTERRUPTED = 130


def stop_event() -> threading.Event:
    """An event that SIGINT, SIGTERM and SIGHUP set. `wait` on it instead of sleeping."""
    stop = threading.Event()

    def end(_number: int, _frame: FrameType | None) -> None:
        # Not from here: the thread that was interrupted may be in `wait` and hold the event's own lock.
        _thread.start_new_thread(stop.set, ())

    for number in SIGNALS:
        signal.signal(number, end)
    return stop


def wait_for_end(stop: threading.Event) -> None:
    """Wait until `stop` is set. Looks up now and then: a signal in the instant before a wait interrupts nothing."""
    while not stop.wait(LOOK):
        pass


def leave(code: int) -> "NoReturn":
    """End this process now, as Python would: after the threads that are no daemons, with all that is due at its end.

    In Python's own end a thread of Zenoh's that still runs may meet statics that are gone, and panics.
    """
    try:
        threading._shutdown()  # type: ignore[attr-defined]  # it waits for them, and ends those of thread pools
    except KeyboardInterrupt:
        code = code or INTERRUPTED
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # it is gone, closed or was never there
            stream.flush()
    os._exit(code)


def dies_with_parent() -> Callable[[], None]:
    """For subprocess's `preexec_fn`: have the kernel end the child when this process is killed."""
    import ctypes

    libc = ctypes.CDLL(None)  # here, and not in the child: an import between fork and exec may hang
    return lambda: libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM) and None
