"""A program in a real pseudo-terminal: keys in, screen out."""

import os
import pty
import select
import sys
import termios
import threading
from collections.abc import Mapping, Sequence
from typing import Any, Self

from holozen.testing.process import Process, wait_for

ROWS, COLUMNS = 32, 100
# Makes the terminal on standard input the controlling one, so that it hangs up and interrupts as real ones do.
_ENTER = "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execvp(sys.argv[1], sys.argv[1:])"


class Terminal:
    """A process and the terminal it runs in. Its output is read all the time, as a terminal does.

    `screen` needs the package pyte; nothing else does.
    """

    def __init__(self, words: Sequence[str], *, env: Mapping[str, str] | None = None) -> None:
        self._master, slave = pty.openpty()
        termios.tcsetwinsize(slave, (ROWS, COLUMNS))
        self.modes_before = self.modes()
        self._bytes = b""
        self._shown = 0  # how many of them the emulator has seen
        self._emulator: Any = None
        self._closing = threading.Event()
        try:
            self.process = Process(
                [sys.executable, "-S", "-c", _ENTER, *words],
                env={"TERM": "xterm-256color", **(env or {})},
                stdin=slave,
                stdout=slave,
                stderr=slave,
            )
        finally:
            os.close(slave)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def type(self, keys: str | bytes) -> None:
        """Press keys: `terminal.type("i")`; a control or arrow key by the bytes it sends, such as `"\\x1b[A"`."""
        os.write(self._master, keys.encode() if isinstance(keys, str) else keys)

    @property
    def raw(self) -> str:
        """All that was written to the terminal, with its control sequences."""
        return self._bytes.decode(errors="replace")

    def screen(self) -> str:
        """What a person sees now, a line a row."""
        try:
            import pyte
        except ModuleNotFoundError:
            raise RuntimeError("Terminal.screen needs pyte; run: pip install pyte") from None
        if self._emulator is None:
            self._emulator = pyte.ByteStream(pyte.Screen(COLUMNS, ROWS))
        new = self._bytes[self._shown :]
        self._shown += len(new)
        self._emulator.feed(new)
        return "\n".join(line.rstrip() for line in self._emulator.listener.display)

    def wait_for_text(self, text: str, within: float = 20.0) -> str:
        """Wait until the screen shows `text`; the screen. AssertionError if the process ends without."""

        def look() -> str | None:
            ended = self.process.returncode is not None
            screen = self.screen()
            if ended and text not in screen:
                raise AssertionError(f"{self.process} ended without {text!r} on its screen:\n{screen}")
            return screen if text in screen else None

        return wait_for(look, within, lambda: f"{text!r} on the screen:\n{self.screen()}") or ""

    def modes(self) -> list[Any]:
        """The terminal's modes (termios), such as echo and line editing; compare with `modes_before`."""
        return termios.tcgetattr(self._master)

    def hang_up(self) -> None:
        """Close the terminal, as its window's button does: the process gets SIGHUP and has no screen left."""
        if not self._closing.is_set():
            self._closing.set()
            self._reader.join()
            os.close(self._master)

    def close(self) -> None:
        """End the process and close the terminal."""
        self.process.close()
        self.hang_up()

    def _read(self) -> None:
        while not self._closing.is_set():
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            try:
                self._bytes += os.read(self._master, 65536)
            except OSError:  # the last process has left the terminal
                self._closing.wait()
