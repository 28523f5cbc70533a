"""Ctrl-Z for a process whose children are in groups of their own, where the terminal's signal does
not reach them.
"""

import contextlib
import os
import signal
import subprocess
from types import FrameType

from holozen.system import parents

GUARD = 'read -r _; kill -CONT "$@"'  # at the end of its input


def suspend_children_too() -> None:
    """Have a SIGTSTP suspend all processes below this one, and then this one; they go on when it
    does.

    Where SIGTSTP is ignored it stays so.
    """
    if signal.getsignal(signal.SIGTSTP) == signal.SIG_DFL:
        signal.signal(signal.SIGTSTP, _suspend)


def _suspend(_number: int, _frame: FrameType | None) -> None:
    stopped: set[int] = set()
    # again, since some may have been starting others
    while new := {*_below(os.getpid())} - stopped:
        for pid in new:
            with contextlib.suppress(OSError):  # it has ended
                # One in our own group is at the terminal, which it has to restore first. In a group
                # without a shell SIGTSTP does nothing.
                os.kill(pid, signal.SIGTSTP if os.getpgid(pid) == os.getpgrp() else signal.SIGSTOP)
        stopped |= new
    # Of a process that is killed meanwhile the children would be suspended for ever: SIGTERM waits
    # until SIGCONT.
    with contextlib.ExitStack() as guarded:
        with contextlib.suppress(OSError):
            guarded.enter_context(_guard(stopped))
        _stop()
    for pid in stopped:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGCONT)


def _guard(pids: set[int]) -> "subprocess.Popen[bytes]":
    """A process that lets others go on when this one ends, or leaves the block."""
    return subprocess.Popen(
        ["/bin/sh", "-c", GUARD, "guard", *map(str, pids)],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _stop() -> None:
    """Be suspended as by default; returns once continued."""
    signal.signal(signal.SIGTSTP, signal.SIG_DFL)
    os.kill(os.getpid(), signal.SIGTSTP)
    signal.signal(signal.SIGTSTP, _suspend)


def _below(ancestor: int) -> list[int]:
    """The processes below one that have not ended."""
    children: dict[int, list[int]] = {}
    for process, parent in parents():
        children.setdefault(parent, []).append(process)
    found: list[int] = []
    look = [ancestor]
    while look:
        there = children.get(look.pop(), [])
        found += there
        look += there
    return found
