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


def told(seconds: float) -> list[str]:
    words = [sys.executable, "-c", ENDS.format(seconds=seconds)]
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout.split()


def test_who_is_late_may_leave_before_the_process_ends() -> None:
    assert told(0.2) == ["waited", "left"]


def test_who_hangs_does_not_keep_the_process() -> None:
    assert told(3600) == ["waited"]
