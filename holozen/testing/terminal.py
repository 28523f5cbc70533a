"""A program in a real pseudo-terminal: keys in, screen out."""

import os
import pty
import select
import termios
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

from holozen.testing.process import PATIENCE, Process, wait_for

SIZE = 100, 32  # columns and rows
# s to wait for the last output of a process that has ended, while another one keeps its terminal
# open
LAST = 1.0


class Terminal:
    """A process and the terminal it runs in. Its output is read continuously, as by a real
    terminal.

    `size` is in columns and rows; `is_new` is as for Process. Only `screen` needs the package pyte.
    """

    def __init__(
        self,
        words: Sequence[str],
        *,
        env: Mapping[str, str] | None = None,
        size: tuple[int, int] = SIZE,
        is_new: bool = False,
    ) -> None:
        self._master, slave = pty.openpty()
        self._size = size
        termios.tcsetwinsize(slave, size[::-1])
        self.modes_before = self.modes()
        self._bytes = b""
        self._shown = 0  # bytes passed to the emulator
        self._emulator: Any = None
        self._screen: str | None = None  # what the emulator shows now, once it was asked
        self._closing, self._frozen, self._reading = (
            threading.Event(),
            threading.Event(),
            threading.Lock(),
        )
        self._read_all = threading.Event()  # set once nothing more can come
        try:
            self.process = Process(
                words,
                # Not inside the tmux or screen that the tests may run in.
                env={"TERM": "xterm-256color", "TMUX": "", "STY": "", **(env or {})},
                stdin=slave,
                stdout=slave,
                stderr=slave,
                terminal=True,
                is_new=is_new,
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
        """Press keys: `terminal.type("i")`; control and arrow keys by their bytes, such as
        `"\\x1b[A"`.
        """
        os.write(self._master, keys.encode() if isinstance(keys, str) else keys)

    def hold(
        self, key: str | bytes, seconds: float, delay: float = 0.5, interval: float = 0.04
    ) -> list[float]:
        """Hold a key for `seconds`, in a terminal that repeats it after `delay` and then every
        `interval` seconds.

        Returns the times at which it was sent, as of time.monotonic.
        """
        sent = [time.monotonic()]
        self.type(key)
        due = sent[0] + delay
        while due <= sent[0] + seconds:
            time.sleep(max(0.0, due - time.monotonic()))
            sent.append(time.monotonic())
            self.type(key)
            due += interval
        return sent

    def hold_until(self, key: str | bytes, condition: Callable[[], object]) -> None:
        """Hold a key until `condition()` is true; AssertionError after 30 s.

        After each 3 s it is let go for a second: a program that was held up, as on a busy machine,
        may disregard a key that was held meanwhile.
        """

        def is_met() -> bool:
            end = time.monotonic() + 3
            while time.monotonic() < end:
                self.type(key)
                if condition():
                    return True
                time.sleep(0.04)
            time.sleep(1)
            return False

        wait_for(is_met, what=lambda: f"what {key!r} does; the screen:\n{self.screen()}")

    def resize(self, columns: int, rows: int) -> None:
        """Resize the window, and notify the process."""
        if self._emulator is not None:
            self.screen()  # the output so far was written for the old size
            self._emulator.listener.resize(rows, columns)
            self._screen = None
        self._size = columns, rows
        termios.tcsetwinsize(self._master, (rows, columns))

    def freeze(self) -> None:
        """Hang like a frozen terminal: read no output of the process until `thaw`."""
        self._frozen.set()
        with self._reading:  # output that is being read is still received
            pass

    def thaw(self) -> None:
        """Resume reading."""
        self._frozen.clear()

    def received(self, data: bytes) -> None:
        """Called with the output of the process. Does nothing; override it in a terminal that
        answers queries.
        """

    @property
    def closed(self) -> bool:
        """Whether it was hung up."""
        return self._closing.is_set()

    @property
    def raw(self) -> str:
        """All output to the terminal, including control sequences."""
        self._catch_up()
        return self._bytes.decode(errors="replace")

    def screen(self) -> str:
        """The visible text, one line for each row."""
        try:
            import pyte
        except ModuleNotFoundError:
            raise RuntimeError("Terminal.screen needs pyte; run: pip install pyte") from None
        if self._emulator is None:
            self._emulator = pyte.ByteStream(pyte.Screen(*self._size))
        self._catch_up()
        if new := self._bytes[self._shown :]:
            self._shown += len(new)
            self._emulator.feed(new)
            self._screen = None
        if self._screen is None:  # it takes some ms
            self._screen = "\n".join(line.rstrip() for line in self._emulator.listener.display)
        return self._screen

    def wait_for_text(self, text: str, within: float = PATIENCE) -> str:
        """Wait until the screen shows `text`, and return the screen. AssertionError if the process
        ends without it.
        """

        def look() -> str | None:
            ended = self.process.returncode is not None
            screen = self.screen()
            if ended and text not in screen:
                raise AssertionError(
                    f"{self.process} ended without {text!r} on its screen:\n{screen}"
                )
            return screen if text in screen else None

        return wait_for(look, within, lambda: f"{text!r} on the screen:\n{self.screen()}") or ""

    def modes(self) -> list[Any]:
        """The terminal's modes (termios), such as echo and line editing; compare with
        `modes_before`.
        """
        return termios.tcgetattr(self._master)

    def hang_up(self) -> None:
        """Close the terminal, like closing its window: the process receives SIGHUP and has no
        screen left.
        """
        if not self._closing.is_set():
            self._closing.set()
            self._reader.join()
            self._read_all.set()
            os.close(self._master)

    def close(self) -> None:
        """End the process and close the terminal."""
        self.process.close()
        self.hang_up()

    def _catch_up(self) -> None:
        """Once the process has ended, wait until all that it wrote has been read."""
        if (
            self.process.returncode is None
            or self._frozen.is_set()
            or threading.current_thread() is self._reader
        ):
            return
        if not self._read_all.wait(LAST):
            self._read_all.set()  # do not wait again

    def _read(self) -> None:
        while not self._closing.is_set():
            with self._reading:
                if (
                    not (frozen := self._frozen.is_set())
                    and select.select([self._master], [], [], 0.02)[0]
                ):
                    try:
                        data = os.read(self._master, 65536)
                    except OSError:  # the last process has left the terminal
                        return self._read_all.set()
                    self._bytes += data
                    self.received(data)
            if frozen:
                self._closing.wait(0.005)
