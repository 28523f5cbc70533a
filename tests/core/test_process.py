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


def test_a_signal_sets_the_event_and_interrupts_nothing() -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        stop = stop_event()
        assert not stop.is_set()
        signal.raise_signal(number)
        assert stop.wait(10), number


def test_a_process_waits_for_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    stop = stop_event()
    threading.Timer(0.01, signal.raise_signal, [signal.SIGTERM]).start()
    wait_for_end(stop)
    assert stop.is_set()


LEAVING = """
import atexit, sys, threading
from holozen.process import Ending
ending = Ending()
import zenoh
atexit.register(print, "what was due")
kept = threading.Event()
target = {"kept": lambda: kept.wait() and print("a thread"), "daemon": threading.Event().wait}[sys.argv[1]]
threading.Thread(target=target, daemon=sys.argv[1] == "daemon").start()
threading.Timer(0.05, kept.set).start()
ending.leave(3)
"""  # noqa: E501


def ended(code: str, *words: str) -> tuple[int, str, str]:
    done = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=60
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("thread", "expected"), [("daemon", "what was due\n"), ("kept", "a thread\nwhat was due\n")]
)
def test_a_process_leaves_when_no_thread_keeps_it(thread: str, expected: str) -> None:
    assert ended(LEAVING, thread) == (3, expected, "")


def test_the_interpreter_is_not_finalized_once_zenoh_is_there() -> None:
    """Its threads abort in that, or panic. A value of a module is destroyed in it."""
    code = (
        "from holozen.process import Ending\nending = Ending()\n"
        "class Late:\n    def __del__(self, print=print): print('finalized')\n"
        "late = Late()\n"
    )
    assert ended(f"{code}import zenoh\nending.leave(0)") == (0, "", "")
    assert ended(f"{code}ending.leave(0)") == (0, "finalized\n", "")


def test_an_uncaught_exception_is_exit_code_1() -> None:
    code, out, reported = ended(
        "from holozen.process import Ending\nEnding()\nimport zenoh\nprint('out')\n1 / 0"
    )
    assert (code, out) == (1, "out\n")
    assert reported.endswith("ZeroDivisionError: division by zero\n")


def test_an_interrupt_ends_the_wait_for_threads() -> None:
    code = (
        "import os, signal, threading, time, zenoh\nfrom holozen.process import Ending\n"
        "def interrupt():\n"
        "    while signal.getsignal(2) is signal.default_int_handler: time.sleep(0.001)\n"
        "    os.kill(os.getpid(), 2)\n"
        "threading.Thread(target=threading.Event().wait).start()\n"
        "threading.Thread(target=interrupt).start()\n"
        "Ending().leave(0)"
    )
    assert ended(code) == (130, "", "")


def test_an_interrupt_is_deferred_to_the_end_of_an_import() -> None:
    code = (
        "import os, signal\nfrom holozen.process import deferred_interrupt\n"
        "try:\n    with deferred_interrupt():\n        os.kill(os.getpid(), 2)\n        "
        "print('within')\n"
        "    print('after')\n"
        "except KeyboardInterrupt:\n    print('interrupted', signal.getsignal(2) is "
        "signal.default_int_handler)\n"
    )
    assert ended(code) == (0, "within\ninterrupted True\n", "")


def test_an_interrupt_in_a_callback_of_the_interpreter_is_not_lost() -> None:
    code = (
        "import signal, sys, time\nfrom holozen.process import interrupt_again\n"
        "sys.unraisablehook = interrupt_again\n"
        "class Object:\n    def __del__(self): signal.raise_signal(2)\n"
        "try:\n    object = Object()\n    del object\n    time.sleep(30)\n"
        "except KeyboardInterrupt:\n    print('interrupted')\n"
        "class Object:\n    def __del__(self): 1 / 0\n"
        "Object()\n"
    )
    ending, out, shown = ended(code)
    assert (ending, out) == (0, "interrupted\n")
    assert shown.endswith("ZeroDivisionError: division by zero\n")


DYING = """
import threading
from holozen.process import Ending, stop_event, wait_for_end
ending, stop = Ending(), stop_event()
threading.Thread(target=lambda: 1 / 0, name="the driver").start()
wait_for_end(stop)
ending.leave(0)
"""


def test_a_thread_that_dies_ends_the_process_with_its_reason() -> None:
    code, _, err = ended(DYING)
    assert code == 1
    assert (
        "the driver ended by ZeroDivisionError: division by zero; this process ends with it" in err
    )
