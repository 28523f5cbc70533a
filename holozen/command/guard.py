"""A process that stops a base's wheels when the base's own has ended, in whatever way, or hangs."""

import contextlib
import fcntl
import os
import select
import signal
import sys
import time
from collections.abc import Callable

from holozen.system import IS_LINUX

SILENCE = 0.3  # s without a beat after which the wheels are stopped
# once the base has ended: one may get lost, while the motors still answer the process that has
LAST_STOPS = 10
PAUSE = 0.02  # s between these
UNREAD = 64  # beats that the guard may leave unread, a power of two; beyond, it is lost


class GuardError(Exception):
    """The guard cannot be started, is gone, or hangs. The text is one line."""


class Guard:
    """Calls `stop` in a process of its own whenever this process has not called `beat` for SILENCE:
    it was killed, crashed, is suspended or hangs. Give it to a Base, which beats at each
    `velocity`.

    Start it before the Bus and all other threads, which a fork does not copy; `stop` then finds
    what was opened before, such as a serial port. It stops the wheels, whoever else sends to them
    at that moment. What it raises is ignored: it is called again.

    It has a session of its own: what suspends or kills this process together with its job or its
    terminal, such as Ctrl-Z, Ctrl-\\ and `kill -9 %1`, does not reach it. Raises GuardError.
    """

    def __init__(self, stop: Callable[[], object]) -> None:
        if not IS_LINUX:
            raise GuardError(
                "a guard needs Linux: drive a real robot from its own computer, such as a Pi"
            )
        if len(os.listdir("/proc/self/task")) > 1:
            raise GuardError(
                "start the guard before the Bus, and before any other thread: a fork copies no "
                "threads"
            )
        # In packet mode each beat takes a page of the pipe, so that a guard that does not read is
        # soon noticed.
        (heard, self._beat), (ready, begun) = os.pipe2(os.O_DIRECT), os.pipe()
        with contextlib.suppress(OSError):  # where pages are large it has room for 16 beats
            fcntl.fcntl(self._beat, fcntl.F_SETPIPE_SZ, UNREAD * os.sysconf("SC_PAGE_SIZE"))
        self.pid = os.fork()
        if not self.pid:
            try:
                os.close(self._beat)
                _keep(stop, heard, begun)
            finally:
                os._exit(0)
        os.close(heard)
        os.close(begun)
        os.set_blocking(self._beat, False)
        is_ready = os.read(ready, 1)
        os.close(ready)
        if not is_ready:
            raise self._lost()

    def beat(self) -> None:
        """Tell it that this process is alive; at each pass of the loop. Raises GuardError."""
        try:
            os.write(self._beat, b".")
        except OSError:  # it is gone, or the pipe is full
            raise self._lost() from None

    def _lost(self) -> GuardError:
        program = os.path.basename(sys.argv[0])
        return GuardError(
            f"the guard that stops the wheels, process {self.pid}, has ended or hangs; start "
            f"{program} again"
        )


def _keep(stop: Callable[[], object], heard: int, begun: int) -> None:
    """Stop the wheels whenever nothing has been `heard` for SILENCE, and for good once it is
    closed. Writes to `begun` when nothing that is sent to the guarded process's job or terminal
    ends this one.
    """
    os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)  # systemd sends SIGTERM to all processes of a unit
    os.write(begun, b".")
    while not (is_heard := bool(select.select([heard], [], [], SILENCE)[0])) or os.read(
        heard, 4096
    ):
        if not is_heard:
            with contextlib.suppress(Exception):
                stop()
    for _ in range(LAST_STOPS):
        with contextlib.suppress(Exception):
            stop()
        time.sleep(PAUSE)
