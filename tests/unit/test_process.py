"""Every signal that ends a process sets its stop event."""

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from holozen.process import SIGNALS, stop_event, wait_for_end


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Puts back what handled the signals before."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_sets_the_event_and_interrupts_nothing(number: signal.Signals) -> None:
    stop = stop_event()
    assert not stop.is_set()
    signal.raise_signal(number)
    assert stop.wait(10)


def test_a_process_waits_for_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    stop = stop_event()
    threading.Timer(0.01, signal.raise_signal, [signal.SIGTERM]).start()
    wait_for_end(stop)
    assert stop.is_set()


LEAVING = """
import atexit, sys, threading
from holozen.process import leave
atexit.register(print, "what was due")
going_on = threading.Event()
threading.Thread(target=lambda: going_on.wait() and print("a thread"), daemon=sys.argv[1] == "daemon").start()
leave(3)
print("it goes on")
going_on.set()
"""


@pytest.mark.parametrize(
    ("thread", "code", "told"),
    [("daemon", 3, "what was due\n"), ("kept", 0, "it goes on\na thread\nwhat was due\n")],
)
def test_a_process_leaves_at_once_unless_a_thread_keeps_it(thread: str, code: int, told: str) -> None:
    done = subprocess.run([sys.executable, "-c", LEAVING, thread], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout, done.stderr) == (code, told, "")
