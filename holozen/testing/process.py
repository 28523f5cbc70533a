"""Processes of a test: their output is kept, and they end with the test."""

import atexit
import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import IO, Any, Self, TypeVar

from holozen.process import dies_with_parent

T = TypeVar("T")

# s between two polls, at first and later: a condition that is met soon is seen at once
SOON, EVERY = (0.0005, 0.005)
GRACE = 3.0  # s from SIGTERM to SIGKILL
START = [sys.executable, "-m", "holozen"]
"""The words that start holozen in a new Python; a verb follows."""
FIXED = ("PYTHON", "LANG", "LC_", "LD_", "MALLOC_", "OPENBLAS_")
"""How the names of those variables begin that count only when a program starts."""
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
"""What holozen's command line sets where it is unset, also in a test that calls it."""
PARENTS = ("up", "launch")
"""Verbs that are not forked: all that they start is in a new Python, and `ps` shows their own
words.
"""
ENTER = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
    "os.execvp(sys.argv[1], sys.argv[1:])"
)
"""A program that makes its standard input its controlling terminal, then runs the words that
follow.
"""
SETPRIV = shutil.which("setpriv")  # of util-linux; sets the signal, then becomes the program
PATIENCE = 30.0  # s; long, since a loaded machine is slow, and only failures wait for all of it


def wait_for(
    condition: Callable[[], T],
    within: float = PATIENCE,
    what: str | Callable[[], str] = "a condition",
) -> T:
    """Wait until `condition()` is true, and return its value. AssertionError after `within`
    seconds.

    `what` describes the condition in the error; a function is called only then.
    """
    deadline, pause = time.monotonic() + within, SOON
    while not (value := condition()):
        if time.monotonic() > deadline:
            words = what if isinstance(what, str) else what()
            raise AssertionError(
                f"waited {within:g} s in vain for {words}; the last look gave {value!r}"
            )
        time.sleep(pause)
        pause = min(1.5 * pause, EVERY)
    return value


class Forked:
    """A verb of holozen, forked by a server that has imported it."""

    def __init__(
        self,
        words: Sequence[str],
        env: dict[str, str],
        files: Sequence[int | IO[bytes]],
        terminal: bool,
    ) -> None:
        words, folder = words[len(START) :], os.getcwd()
        request = json.dumps({"words": words, "env": env, "folder": folder, "terminal": terminal})
        end, theirs = socket.socketpair()
        with end, theirs, open(os.devnull, "r+b", buffering=0) as null:
            standard = [null if file == subprocess.DEVNULL else file for file in files]
            given = [
                file if isinstance(file, int) else file.fileno() for file in (*standard, theirs)
            ]
            socket.send_fds(_server()[0], [request.encode()], given)
            theirs.close()
            pid, descriptors, _, _ = socket.recv_fds(end, 16, 1)
            if not pid:
                raise RuntimeError("the fork server has ended")
            self.pid, self._descriptors = int(pid), (*descriptors, end.detach())
        self.returncode: int | None = None
        self._lock = threading.Lock()

    def __del__(self) -> None:
        for descriptor in getattr(self, "_descriptors", ()):
            os.close(descriptor)

    def poll(self) -> int | None:
        """The exit code, -N after signal N; None while it runs."""
        with self._lock:
            if self.returncode is None and select.select([self._descriptors[1]], [], [], 0)[0]:
                status = os.read(self._descriptors[1], 16)
                # without a status, the server has ended
                self.returncode = int(status or -signal.SIGTERM)
            return self.returncode

    def wait(self, timeout: float) -> int:
        """The exit code, once it has ended. Raises TimeoutExpired after `timeout` seconds."""
        if self.poll() is None:
            select.select([self._descriptors[1]], [], [], timeout)
        if (code := self.poll()) is None:
            raise subprocess.TimeoutExpired("holozen", timeout)
        return code

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        with suppress(ProcessLookupError):  # it has ended
            signal.pidfd_send_signal(self._descriptors[0], number)


class Process:
    """A running program, the leader of its own session. `out` and `err` are its output so far. It
    gets a SIGTERM when the thread that started it ends, or if it is forked the test's process, so
    that a killed test leaves nothing behind.

    `stdin`, `stdout` and `stderr` are as for subprocess.Popen; by default the first is empty, the
    others are captured. With `terminal`, the first is a terminal, which becomes its controlling
    one: it delivers hang-ups and interrupts.

    A verb of holozen is forked from a process that has imported it already, unless `is_new`.
    """

    def __init__(
        self,
        words: Sequence[str],
        *,
        env: Mapping[str, str] | None = None,
        stdin: int | IO[bytes] = subprocess.DEVNULL,
        stdout: int | IO[bytes] | None = None,
        stderr: int | IO[bytes] | None = None,
        terminal: bool = False,
        is_new: bool = False,
    ) -> None:
        self.words = list(words)
        # Files rather than pipes: a process with much output never blocks.
        self._out, self._err = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115
        self._ended: tuple[str, str] | None = None
        self._popen = self._start(
            {**os.environ, **(env or {})},
            (
                stdin,
                self._out if stdout is None else stdout,
                self._err if stderr is None else stderr,
            ),
            terminal,
            is_new,
        )
        self.pid = self._popen.pid

    def _start(
        self, env: dict[str, str], files: Sequence[int | IO[bytes]], terminal: bool, is_new: bool
    ) -> subprocess.Popen[bytes] | Forked:
        if not is_new and _can_fork(self.words, env):
            return Forked(self.words, env, files, terminal)
        # A preexec_fn needs a fork, which takes 50 ms in a test process of 900 MB.
        wrapper = (
            [SETPRIV, "--pdeathsig", "TERM"] if SETPRIV and shutil.which(self.words[0]) else []
        )
        if terminal:
            wrapper += [sys.executable, "-S", "-c", ENTER]
        stdin, stdout, stderr = files
        return subprocess.Popen(
            [*wrapper, *self.words],
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
            env=env,
            start_new_session=True,
            preexec_fn=None if wrapper else dies_with_parent(),
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return (
            f"<{' '.join(self.words)}: "
            f"{'runs' if self.returncode is None else f'exit code {self.returncode}'}>"
        )

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
        """The first line of its output or errors that contains `text`. AssertionError if it ends
        without one.
        """

        def look() -> str | None:
            ended = self.returncode is not None
            found = next(
                (line for line in f"{self.out}\n{self.err}".splitlines() if text in line), None
            )
            if ended and found is None:
                raise AssertionError(
                    f"{self} ended without {text!r}; it wrote:\n{self.out}{self.err}"
                )
            return found

        return (
            wait_for(
                look, within, lambda: f"{text!r} from {self}, which wrote:\n{self.out}{self.err}"
            )
            or ""
        )

    def wait(self, within: float = PATIENCE) -> int:
        """Wait for its end and return the exit code. AssertionError if it keeps running."""
        try:
            return self._popen.wait(within)
        except subprocess.TimeoutExpired:
            raise AssertionError(
                f"{self} still runs after {within:g} s; it wrote:\n{self.out}{self.err}"
            ) from None

    def signal(self, number: int) -> None:
        """Send it a signal."""
        self._popen.send_signal(number)

    def interrupt(self, within: float = PATIENCE) -> int:
        """Send SIGINT, as Ctrl-C does, wait for its end and return the exit code."""
        self.signal(signal.SIGINT)
        return self.wait(within)

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


def run(
    words: Sequence[str], within: float = PATIENCE, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end. Options are those of Process. AssertionError if it keeps
    running.
    """
    with Process(words, **options) as process:
        code = process.wait(within)
    return subprocess.CompletedProcess(words, code, process.out, process.err)


def _can_fork(words: Sequence[str], env: Mapping[str, str]) -> bool:
    """Whether a fork would do what these words do in a new Python with these variables."""
    start, verb = list(words[: len(START)]), words[len(START) :][:1]
    if not hasattr(os, "pidfd_open") or start != START or not verb or verb[0] in PARENTS:
        return False
    with _starting:  # tests start processes in several threads
        fixed = _server()[1]
    return _fixed(env) == fixed


def _fixed(env: Mapping[str, str]) -> dict[str, str]:
    """Those variables, as they are once holozen's command line has begun."""
    begun = {**ONE_THREAD, **env}
    return {name: value for name, value in begun.items() if name.startswith(FIXED)}


_starting = threading.Lock()


@cache
def _server() -> tuple[socket.socket, dict[str, str]]:
    """The socket of this process's fork server, and the variables that all it forks have."""
    ours, theirs = socket.socketpair(type=socket.SOCK_SEQPACKET)
    env = {**os.environ, **ONE_THREAD}  # a process with threads cannot be forked
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "holozen.testing.fork_server", str(theirs.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            env=env,
            start_new_session=True,
        )

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours, _fixed(env)


def _content(file: IO[bytes]) -> str:
    return os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0).decode(errors="replace")
