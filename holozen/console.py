"""Output for people: lines, and pictures redrawn in a terminal.

Writing a line never blocks: if a pipe is not read, or Ctrl-S holds the terminal, lines are dropped.
Their number is reported once reading resumes.
"""

import _thread
import atexit
import contextlib
import os
import select
import sys
import threading
import time
from collections import deque
from typing import Self

KEPT = 256  # lines queued for a slow reader
# s; usually enough to write the line, which keeps the order of a process's output
SHORT_WAIT = 0.005
LOG_WAIT = 0.1  # s, once, for a slow reader of a script's log
LAST_WAIT = 0.2  # s without progress, after which output that is not read is abandoned at exit
BUSY = 5.0  # s at most at exit, on a busy machine
EVERY = {True: 0.1, False: 1.0}  # s between two pictures, in a terminal and elsewhere
SIZE = (80, 24)
# enter the alternate screen and hide the cursor; undo it
_BEGIN, _END = ("\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l")


class Failure(Exception):
    """A request that cannot be met. One line, for a person: what was given, where, what is allowed,
    what to do.
    """


def printable(text: str) -> str:
    """`text` with `?` for each control character, since parts of it may come over the wire."""
    return text if text.isprintable() else "".join(c if c.isprintable() else "?" for c in text)


def report(text: str) -> None:
    """Write one line on standard error; after `write_json`, an object on standard output."""
    if _Form.is_json:
        output(text)
    else:
        _ERRORS.write(printable(text))


def output(text: str) -> None:
    """Write one line on standard output, without blocking if it is not read."""
    if _Form.is_json:
        import json

        text = json.dumps({"text": text})
    _OUTPUT.write(printable(text))


class _Form:
    """Whether lines are JSON."""

    is_json = False


def write_json() -> None:
    """Let `report` and `output` write JSON from now on, one object a line."""
    _Form.is_json = True


def tell(text: str) -> None:
    """Print one line about what a verb has done. The verb goes on if the reader, such as head, has
    gone.
    """
    try:
        print(text, flush=True)
    except BrokenPipeError:
        discard(sys.stdout.fileno())


def discard(number: int) -> None:
    """Send what is written to a file descriptor from now on to /dev/null."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, number)
    os.close(null)


def log(text: str, stdout: bool = False) -> None:
    """Write a script's log unchanged, with line breaks and colours, on standard error or output."""
    (_OUTPUT if stdout else _ERRORS).write(text, LOG_WAIT)


def drain(seconds: float = LAST_WAIT) -> None:
    """Wait until all lines are written, or nothing has been read for `seconds`."""
    for lines in (_OUTPUT, _ERRORS):
        lines.drain(seconds)


def give_up_readers() -> None:
    """Send each output that is not being read to /dev/null. For signal handlers: a main thread that
    is blocked in `write` goes on too, since the signal interrupts the call and Python retries it.
    """
    for lines in (_OUTPUT, _ERRORS):
        lines.give_up()


class _Lines:
    """A queue of lines for a file descriptor. A thread writes them, since `os.write` waits for the
    reader.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        self._waiting: deque[bytes] = deque()
        self._dropped = 0
        self._is_given_up = False
        # Bare locks, and no Event: Ctrl-C just after that has taken its lock would leave it locked.
        self._lock, self._written = threading.Lock(), threading.Lock()
        self._room = threading.Condition(self._lock)
        self._is_idle = True

    def write(self, line: str, patience: float = SHORT_WAIT) -> None:
        """Queue a line. If the queue is full, wait `patience` seconds for room, but only for the
        first line dropped.
        """
        stream, usual = (
            (sys.stdout, sys.__stdout__) if self._number == 1 else (sys.stderr, sys.__stderr__)
        )
        if stream is not usual:  # replaced by a test or a script
            # neither a vanished terminal nor a closed file is an error
            with contextlib.suppress(OSError, ValueError):
                print(line, file=stream, flush=True)
            return
        if stream is None:  # closed by the parent process; the descriptor may be another file's now
            return
        with self._lock:
            if not self._dropped:
                self._room.wait_for(lambda: len(self._waiting) < KEPT, patience)
            if len(self._waiting) >= KEPT:
                self._dropped += 1
                return
            self._waiting.append(line.encode(errors="replace") + b"\n")
            if was_idle := self._is_idle:
                self._written.acquire(blocking=False)
                _thread.start_new_thread(self._run, ())
                self._is_idle = False
        if was_idle:
            self._written.acquire(timeout=SHORT_WAIT)

    def give_up(self) -> None:
        """Send output to /dev/null if it is not being read. Takes no lock: a signal may come while
        it is held.
        """
        poll = select.poll()
        poll.register(self._number, select.POLLOUT)
        if (sys.__stdout__ if self._number == 1 else sys.__stderr__) is None or poll.poll(0):
            return
        self._is_given_up = True
        discard(self._number)

    def drain(self, seconds: float) -> None:
        """Wait until all is written, or the reader has read nothing for `seconds`."""
        poll = select.poll()
        poll.register(self._number, select.POLLOUT)
        now = time.monotonic()
        end, given_up = now + BUSY, now + seconds
        while not (self._is_given_up or self._is_idle or self._written.acquire(timeout=0.01)):
            now = time.monotonic()
            if poll.poll(0):  # there is room: the writing thread has not run yet, on a busy machine
                given_up = now + seconds
            if now >= min(end, given_up):
                return

    def _run(self) -> None:
        while data := self._next():
            while data:
                try:
                    data = data[os.write(self._number, data) :]
                # another process has made the shared terminal or pipe non-blocking
                except BlockingIOError:
                    select.select([], [self._number], [], LOG_WAIT)
                except OSError:  # the reader is gone
                    discard(self._number)

    def _next(self) -> bytes:
        """The next data to write; empty when this thread may end."""
        with self._lock:
            if self._waiting:
                self._room.notify()
                return self._waiting.popleft()
            dropped, self._dropped = self._dropped, 0
            if dropped:
                return f"... and {dropped} more lines were dropped, as the output was not read\n".encode()  # noqa: E501
            self._is_idle = True
            if self._written.locked():
                self._written.release()
            return b""


_OUTPUT, _ERRORS = _Lines(1), _Lines(2)
atexit.register(drain)


class Line:
    """A status line on standard error, overwritten in place. Without a terminal it is not shown."""

    def __init__(self, hidden: bool = False) -> None:
        self.shown = sys.stderr.isatty() and not hidden

    def show(self, text: str) -> None:
        """Overwrite the line."""
        if self.shown:
            with contextlib.suppress(OSError):  # the terminal is gone, and SIGHUP follows
                sys.stderr.write(f"\r{printable(text)}\x1b[K")
                sys.stderr.flush()


class Screen:
    """Redraws pictures in a terminal; elsewhere prints them in sequence. Use it in `with`: it
    restores the terminal.
    """

    def __init__(self, once: bool, ascii: bool = False) -> None:
        self.terminal = sys.stdout.isatty() and not once
        self.every = EVERY[self.terminal]
        encoding = (sys.stdout.encoding or "").lower().replace("-", "")
        self.ascii = ascii or encoding != "utf8"

    def __enter__(self) -> Self:
        self._write(_BEGIN)
        return self

    def __exit__(self, *_error: object) -> None:
        self._write(_END)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the terminal; 80 x 24 where there is none."""
        if not self.terminal:
            return SIZE
        columns, rows = os.get_terminal_size(sys.stdout.fileno())
        return max(columns, 20), max(rows, 4)

    def show(self, lines: list[str]) -> None:
        """Draw a picture."""
        if self.terminal:
            # Overwritten line by line: clearing the screen would flicker.
            self._write("\x1b[H" + "\x1b[K\r\n".join(lines[: self.size[1]]) + "\x1b[K\x1b[J")
        else:
            print("\n".join(line.rstrip() for line in lines), flush=True)

    def _write(self, text: str) -> None:
        if not self.terminal:
            return
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except OSError:  # the terminal is gone: end quietly, as with a closed pipe
            raise BrokenPipeError from None
