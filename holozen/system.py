"""What Linux has and macOS lacks, with what is used instead."""

from __future__ import annotations

import os
import sys
import time

TYPE_CHECKING = False  # of typing, which every verb would load
if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import IO

IS_LINUX = sys.platform == "linux"
UPTIME = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""A clock that advances while the computer sleeps; macOS's CLOCK_MONOTONIC does."""


def memory_file(name: str) -> IO[bytes]:
    """A file in memory, which needs no writable folder and has a limit to its size; on macOS a
    temporary one.
    """
    if hasattr(os, "memfd_create"):
        return open(os.memfd_create(name), "w+b")
    import tempfile

    return tempfile.TemporaryFile()


def parents() -> Iterator[tuple[int, int]]:
    """Each process of this machine that has not ended, and its parent."""
    from contextlib import suppress

    if not IS_LINUX:
        import subprocess

        rows = subprocess.run(
            ["ps", "-A", "-o", "pid=,ppid=,stat="], capture_output=True, text=True
        ).stdout
        yield from (
            (int(pid), int(parent))
            for pid, parent, state in map(str.split, rows.splitlines())
            if state != "Z"
        )
        return
    for name in filter(str.isdecimal, os.listdir("/proc")):
        # it has ended
        with suppress(OSError, ValueError), open(f"/proc/{name}/stat", errors="replace") as stat:
            state, parent = stat.read().rpartition(")")[2].split()[:2]
            if state != "Z":
                yield int(name), int(parent)
