"""A process of a launch: what it writes is passed on line by line, after its name."""

import contextlib
import os
import select
import subprocess
import sys
from collections.abc import Callable
from typing import IO

from holozen.process import dies_with_parent
from holozen.ros.launch.context import Program
from holozen.ros.launch.entity import Action
from holozen.ros.launch.text import LaunchError

CHUNK = 65536  # bytes
LOOK = 0.05  # s between two looks whether who reads nothing is waited for
LONGEST = 1_000_000  # bytes of a line that is kept until its end comes


class Running:
    """A process. It is the leader of a group of its own: no key of the terminal reaches it.

    Once `hurried` says so, what nobody reads is dropped.
    """

    def __init__(
        self, action: Action, program: Program, name: str, hurried: Callable[[], bool] = lambda: False
    ) -> None:
        self.action, self.program, self.name = action, program, name
        words = program.words[0] if program.shell else list(program.words)
        try:
            self._popen = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                cwd=program.cwd,
                env={**program.environment, "PYTHONUNBUFFERED": "1"},  # its lines come when they are written
                shell=program.shell,
                start_new_session=True,
                preexec_fn=dies_with_parent(),
            )
        except (OSError, ValueError) as error:
            told = getattr(error, "strerror", "") or error
            raise LaunchError(f"cannot start {program.words[0]!r:.200}: {told}", action.place) from None
        streams = ((self._popen.stdout, sys.stdout), (self._popen.stderr, sys.stderr))
        self.pipes = [Pipe(name, source, sink, hurried) for source, sink in streams if source is not None]

    @property
    def has_ended(self) -> bool:
        """Whether it runs no more. Its number is kept from others until `finish`."""
        if self._popen.returncode is not None:
            return True
        return os.waitid(os.P_PID, self._popen.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None

    def signal(self, number: int) -> None:
        """Send a signal to it, and to what it has started."""
        if self._popen.returncode is None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._popen.pid, number)

    def finish(self) -> int:
        """Pass on what is left, and close; the exit code, -N after signal N."""
        code = self._popen.wait()
        for pipe in self.pipes:
            while pipe.read():
                pass
            pipe.close()
        return code


class Pipe:
    """One of the two outputs of a process, and where it goes."""

    def __init__(self, name: str, source: IO[bytes], sink: IO[str], hurried: Callable[[], bool]) -> None:
        self.source, self._sink, self._mark = source, sink, f"[{name}] ".encode()
        self._hurried = hurried
        self._rest = b""
        os.set_blocking(source.fileno(), False)

    def read(self) -> bool:
        """Pass on the lines that are there; whether there may be more."""
        try:
            data = os.read(self.source.fileno(), CHUNK)
        except BlockingIOError:
            return False
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST or not data:
            lines, self._rest = [*lines, *([self._rest] if self._rest else [])], b""
        self._write(lines)
        return bool(data)

    def close(self) -> None:
        """Pass on a line without an end."""
        self._write([self._rest] if self._rest else [])
        self._rest = b""
        self.source.close()

    def _write(self, lines: list[bytes]) -> None:
        if lines:
            self._sink.flush()
            text = b"".join(self._mark + line + b"\n" for line in lines)
            _pass_on(self._sink, text, self._hurried)


def _pass_on(sink: IO[str], text: bytes, hurried: Callable[[], bool]) -> None:
    """Write all of it, or what is read until `hurried`: a launch that waits for its reader would end no process."""
    try:
        number = sink.fileno()
    except (OSError, ValueError):  # it is no file
        sink.write(text.decode(errors="replace"))
        return
    while text:
        if select.select([], [number], [], LOOK)[1]:
            text = text[os.write(number, text[: select.PIPE_BUF]) :]  # for so many there is room
        elif hurried():
            return
