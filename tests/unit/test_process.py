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
kept = threading.Event()
target = {"kept": lambda: kept.wait() and print("a thread"), "daemon": threading.Event().wait}[sys.argv[1]]
threading.Thread(target=target, daemon=sys.argv[1] == "daemon").start()
threading.Timer(0.05, kept.set).start()
leave(3)
"""


@pytest.mark.parametrize(("thread", "told"), [("daemon", "what was due\n"), ("kept", "a thread\nwhat was due\n")])
def test_a_process_leaves_when_no_thread_keeps_it(thread: str, told: str) -> None:
    done = subprocess.run([sys.executable, "-c", LEAVING, thread], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout, done.stderr) == (3, told, "")


def test_an_interrupt_ends_the_wait_for_threads() -> None:
    code = (
        "import os, threading\nfrom holozen.process import leave\n"
        "threading.Thread(target=threading.Event().wait).start()\n"
        "threading.Timer(0.05, os.kill, [os.getpid(), 2]).start()\n"
        "leave(0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
