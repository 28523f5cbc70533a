"""What every long-running process shares: how it is told to end."""

import _thread
import signal
import threading
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LOOK = 0.5  # s


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
