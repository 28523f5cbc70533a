"""The end of threads that may be inside Zenoh. Light: every process loads it."""

from __future__ import annotations

import atexit
import threading
import time
from collections.abc import Iterable

LAST = 1.0  # s that the process itself waits when it ends


def wait(threads: Iterable[threading.Thread | None], seconds: float) -> None:
    """Wait for the end of threads, at most so long; who runs on gets some more time when the process ends.

    An interpreter aborts if a thread comes out of Zenoh while it ends.
    """
    others = [thread for thread in threads if thread and thread is not threading.current_thread()]
    if late := _join(others, seconds):
        atexit.register(_join, late, LAST)


def _join(threads: list[threading.Thread], seconds: float) -> list[threading.Thread]:
    """Those that run on."""
    deadline = time.monotonic() + seconds
    for thread in threads:
        thread.join(max(0.0, deadline - time.monotonic()))
    return [thread for thread in threads if thread.is_alive()]
