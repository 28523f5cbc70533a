"""A process waits for threads that are about to come out of Zenoh, and not for ever."""

import subprocess
import sys

ENDS = """
import threading, time
from holozen.transport import session

def leave():
    time.sleep({seconds})
    print("left", flush=True)

thread = threading.Thread(target=leave, daemon=True)
thread.start()
session.wait_for_threads((thread, None, threading.current_thread()), 0.01)
print("waited", flush=True)
"""


def reported(seconds: float) -> list[str]:
    words = [sys.executable, "-c", ENDS.format(seconds=seconds)]
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout.split()


def test_a_late_thread_may_leave_before_the_process_ends() -> None:
    assert reported(0.2) == ["waited", "left"]


def test_a_hanging_thread_does_not_keep_the_process() -> None:
    assert reported(3600) == ["waited"]
