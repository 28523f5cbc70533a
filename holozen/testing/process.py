"""Processes of a test: their output is kept, and they end with the test."""

import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from typing import IO, Self, TypeVar

from holozen.process import dies_with_parent

T = TypeVar("T")

SOON, EVERY = 0.0005, 0.005  # s between two polls, at first and later: a condition that is met soon is seen at once
GRACE = 3.0  # s from SIGTERM to SIGKILL
SETPRIV = shutil.which("setpriv")  # of util-linux; sets the signal, then becomes the program
PATIENCE = 30.0  # s; long, since a loaded machine is slow, and only failures wait for all of it


def wait_for(condition: Callable[[], T], within: float = PATIENCE, what: str | Callable[[], str] = "a condition") -> T:
    """Wait until `condition()` is true, and return its value. AssertionError after `within` seconds.

    `what` describes the condition in the error; a function is called only then.
    """
    deadline, pause = time.monotonic() + within, SOON
    while not (value := condition()):
        if time.monotonic() > deadline:
            words = what if isinstance(what, str) else what()
            raise AssertionError(f"waited {within:g} s in vain for {words}; the last look gave {value!r}")
        time.sleep(pause)
        pause = min(1.5 * pause, EVERY)
    return value


class Process:
    """A running program, the leader of its own session. `out` and `err` are its output so far. It gets a SIGTERM when
    the thread that started it ends, so that a killed test leaves nothing behind.

    `stdin`, `stdout` and `stderr` are as for subprocess.Popen; by default the first is empty, the others are captured.
    """

    def __init__(
        self,
        words: Sequence[str],
        *,
        env: Mapping[str, str] | None = None,
        stdin: int | IO[bytes] = subprocess.DEVNULL,
        stdout: int | IO[bytes] | None = None,
        stderr: int | IO[bytes] | None = None,
    ) -> None:
        self.words = list(words)
        # Files rather than pipes: a process with much output never blocks.
        self._out, self._err = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115
        self._ended: tuple[str, str] | None = None
        # A preexec_fn needs a fork, which takes 50 ms in a test process of 900 MB.
        wrapper = [SETPRIV, "--pdeathsig", "TERM"] if SETPRIV and shutil.which(self.words[0]) else []
        self._popen = subprocess.Popen(
            [*wrapper, *self.words],
            stdin=stdin,
            stdout=self._out if stdout is None else stdout,
            stderr=self._err if stderr is None else stderr,
            env={**os.environ, **(env or {})},
            start_new_session=True,
            preexec_fn=None if wrapper else dies_with_parent(),
        )
        self.pid = self._popen.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<{' '.join(self.words)}: {'runs' if self.returncode is None else f'exit code {self.returncode}'}>"

    @property
    def out(self) -> str:
        """Standard output so far."""
        return self._ended[0] if self._ended else _content(self._out)

    @property
    def err(self) -> str:
        """Standard error so far."""
        return self._ended[1] if self._ended else _content(self._err)

    @property
    def returncode(self) -> int | None:
        """The exit code, -N after signal N, None while it runs."""
        return self._popen.poll()

    def wait_for_line(self, text: str, within: float = PATIENCE) -> str:
        """The first line of its output or errors that contains `text`. AssertionError if it ends without one."""

        def look() -> str | None:
            ended = self.returncode is not None
            found = next((line for line in f"{self.out}\n{self.err}".splitlines() if text in line), None)
            if ended and found is None:
                raise AssertionError(f"{self} ended without {text!r}; it wrote:\n{self.out}{self.err}")
            return found

        return wait_for(look, within, lambda: f"{text!r} from {self}, which wrote:\n{self.out}{self.err}") or ""

    def wait(self, within: float = PATIENCE) -> int:
        """Wait for its end and return the exit code. AssertionError if it keeps running."""
        try:
            return self._popen.wait(within)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self} still runs after {within:g} s; it wrote:\n{self.out}{self.err}") from None

    def signal(self, number: int) -> None:
        """Send it a signal."""
        self._popen.send_signal(number)

    def terminate(self, within: float = PATIENCE) -> int:
        """Send SIGTERM, wait for its end and return the exit code."""
        self.signal(signal.SIGTERM)
        return self.wait(within)

    def kill(self) -> int:
        """Send SIGKILL, wait for its end and return the exit code."""
        self.signal(signal.SIGKILL)
        return self.wait()

    def close(self) -> None:
        """End it, gracefully if it reacts to SIGTERM; `out` and `err` stay available."""
        self.signal(signal.SIGTERM)
        self.signal(signal.SIGCONT)  # in case a test has suspended it
        try:
            self._popen.wait(GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
        self._ended = self.out, self.err
        self._out.close()
        self._err.close()


def _content(file: IO[bytes]) -> str:
    return os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0).decode(errors="replace")
