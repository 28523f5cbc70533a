"""The terminal kitty on a virtual screen, with keys that a test holds down."""

import contextlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self
from uuid import uuid4

import pyte

from holozen.testing import Process, wait_for

COLUMNS, ROWS = 100, 32
QUICK = {"LIBGL_ALWAYS_SOFTWARE": "1", "KITTY_ENABLE_WAYLAND": "0"}

# What runs in kitty in place of a shell: it starts what it is given, and reports how the terminal
# was left.
SHELL = """
import json, os, re, socket, subprocess, sys, termios, tty
channel = socket.socket(socket.AF_UNIX)
channel.connect(sys.argv[1])
lines = channel.makefile("rw")

def ask(question):
    before = termios.tcgetattr(0)
    tty.setraw(0)
    os.write(1, question.encode())
    answer = b""
    while not re.search(rb"\\x1b\\[[?][0-9;]*c", answer):
        answer += os.read(0, 1000)
    termios.tcsetattr(0, termios.TCSAFLUSH, before)
    return re.search(rb"\\x1b\\[[?]([0-9]*)u", answer)[1].decode()

for line in lines:
    words = json.loads(line)
    before = termios.tcgetattr(0)
    process = subprocess.Popen(words)
    print(json.dumps({"pid": process.pid}), file=lines, flush=True)
    code = process.wait()
    left = {
        "code": code,
        "modes": termios.tcgetattr(0)[:4] == before[:4],
        "flags": ask("\\x1b[?u\\x1b[c"),
        "flags of the other screen": ask("\\x1b[?1049h\\x1b[?u\\x1b[?1049l\\x1b[c"),
    }
    print(json.dumps(left), file=lines, flush=True)
"""


class Display:
    """An X server without a screen, and a hand on its keyboard."""

    def __init__(self) -> None:
        ours, its = os.pipe()
        self._server = Process(
            ["Xvfb", "-displayfd", "1", "-screen", "0", "1000x800x24", "-nolisten", "tcp"],
            stdout=its,
        )
        os.close(its)
        with open(ours) as chosen:
            number = chosen.readline().strip()
        assert number, f"Xvfb did not start: {self._server.err}"
        self.env = {"DISPLAY": f":{number}", **QUICK}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._server.close()

    def run(self, *words: str) -> str:
        """Run a client of the X server, such as xdotool, until it ends. Returns its output."""
        done = subprocess.run(
            words, env=os.environ | self.env, capture_output=True, text=True, timeout=20, check=True
        )
        return done.stdout

    def keys(self, *words: str) -> None:
        """`keys("keydown", "shift", "keydown", "j")`: xdotool's commands; a number is the code of a
        key.
        """
        self.run("xdotool", *words)

    @property
    def pid(self) -> int:
        """Its process."""
        return self._server.pid

    def focus(self, window: str) -> None:
        """Give the keyboard to a window."""
        self.run("xdotool", "windowfocus", "--sync", window)

    @property
    def root(self) -> str:
        """The root window, behind all others."""
        return self.run("xdotool", "search", "--maxdepth", "0", "").split()[0]


class Kitty:
    """A kitty that runs one program after the other. `folder` is for its files."""

    def __init__(self, display: Display, folder: Path) -> None:
        self.display = display
        self._dump, self._class = folder / "bytes", f"kitty-{uuid4().hex[:8]}"
        with socket.socket(socket.AF_UNIX) as door:
            door.bind(str(folder / "door"))
            door.listen()
            door.settimeout(60)
            self._process = Process(
                [
                    *_kitty(self._dump, self._class),
                    sys.executable,
                    "-S",
                    "-c",
                    SHELL,
                    str(folder / "door"),
                ],
                env={**display.env, "HOME": str(folder), "KITTY_CONFIG_DIRECTORY": str(folder)},
            )
            try:
                self._shell = door.accept()[0]
            except TimeoutError:
                self._process.close()
                raise AssertionError(f"kitty did not start: {self._process.err}") from None
        self._lines = self._shell.makefile("r")
        self._shell.settimeout(30)
        self.window = wait_for(lambda: self._windows()[:1], 30, "kitty's window")[0]
        display.focus(self.window)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._process.close()
        self._lines.close()
        self._shell.close()

    def run(self, words: Sequence[str]) -> "Program":
        """Start a program in it."""
        begin = len(self.bytes())
        self._shell.sendall(f"{json.dumps(list(words))}\n".encode())
        return Program(self, self.reply()["pid"], begin)

    def reply(self) -> dict[str, Any]:
        """The next reply of its shell."""
        output: dict[str, Any] = json.loads(self._lines.readline())
        return output

    def bytes(self, begin: int = 0) -> bytes:
        """All that was written to it, after the first `begin` bytes."""
        with contextlib.suppress(FileNotFoundError), self._dump.open("rb") as dump:
            dump.seek(begin)
            return dump.read()
        return b""

    @property
    def pid(self) -> int:
        """Its process."""
        return self._process.pid

    def signal(self, number: int) -> None:
        """Send kitty itself a signal."""
        self._process.signal(number)

    def close_window(self) -> None:
        """Close the window, as its button does."""
        self.display.run("xdotool", "windowclose", self.window)
        self._process.wait()

    def _windows(self) -> list[str]:
        with contextlib.suppress(subprocess.CalledProcessError):
            return self.display.run(
                "xdotool", "search", "--onlyvisible", "--class", self._class
            ).split()
        return []


class Program:
    """What runs in kitty now."""

    def __init__(self, kitty: Kitty, pid: int, begin: int) -> None:
        self.kitty, self.pid, self._begin = kitty, pid, begin
        self._left: dict[str, Any] | None = None
        self._shown = begin  # bytes passed to the emulator
        self._screen = pyte.Screen(COLUMNS, ROWS)
        self._emulator = pyte.ByteStream(self._screen)

    @property
    def raw(self) -> str:
        """All that it has written, with its control sequences."""
        return self.kitty.bytes(self._begin).decode(errors="replace")

    def screen(self) -> str:
        """What a person sees now, a line a row."""
        new = self.kitty.bytes(self._shown)
        self._shown += len(new)
        self._emulator.feed(new)
        return "\n".join(line.rstrip() for line in self._screen.display)

    def wait_for_text(self, text: str) -> str:
        """Wait until the screen shows `text`; the screen."""

        def look() -> str | None:
            screen = self.screen()
            return screen if text in screen else None

        return wait_for(look, 20, lambda: f"{text!r} on the screen:\n{self.screen()}") or ""

    def signal(self, number: int) -> None:
        """Send it a signal."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    @property
    def runs(self) -> bool:
        """Whether it still runs."""
        return self._left is None and Path(f"/proc/{self.pid}").exists()

    def end(self) -> None:
        """End it by SIGTERM, unless it has ended."""
        if self._left is None:
            self.signal(15)
            self.ended()

    def ended(self) -> dict[str, Any]:
        """Wait for its end. Returns its exit "code", whether the terminal's "modes" are as before,
        and the keyboard "flags" of both screens.
        """
        if self._left is None:
            self._left = self.kitty.reply()
        return self._left


def _kitty(dump: Path, window_class: str) -> list[str]:
    options = (
        "confirm_os_window_close=0",
        "update_check_interval=0",
        "remember_window_size=no",
        "font_size=8",
        f"initial_window_width={COLUMNS}c",
        f"initial_window_height={ROWS}c",
    )
    overrides = [word for option in options for word in ("-o", option)]
    return [
        "kitty",
        "--class",
        window_class,
        "--config",
        "NONE",
        *overrides,
        "--dump-bytes",
        str(dump),
    ]
