"""A simulated terminal: it answers queries as a certain terminal does, or late, or never.

The answers were taken from kitty 0.26.5 and tmux 3.3a; those of the Linux console from its source,
drivers/tty/vt/vt.c; those of xterm from its control sequences' documentation.
"""

import re
import threading
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from holozen.testing import Terminal

QUESTION = re.compile(rb"\x1b\[([<>=?]?)([\d;]*)(\$?[a-zA-Z])")
PRESS, REPEAT, RELEASE = 1, 2, 3
SHIFT, ALT, CTRL, CAPS, NUM = 1, 2, 4, 64, 128
FOCUS_IN, FOCUS_OUT = "\x1b[I", "\x1b[O"


class Kind(NamedTuple):
    """What a terminal answers. `keyboard`: it speaks the Kitty keyboard protocol; the others are ""
    for no answer.
    """

    keyboard: bool = False
    device: str = ""
    alive: str = "\x1b[0n"


KITTY = Kind(True, "\x1b[?62;c")
XTERM = Kind(False, "\x1b[?64;1;2;6;9;15;16;17;18;21;22;28c")
TMUX = Kind(False, "\x1b[?1;2c")
CONSOLE = Kind(False, "\x1b[?6c")
DUMB = Kind(False, "", "")


class Played(Terminal):
    """A terminal of some kind. `late`: seconds until it answers. `kind` may be changed while it
    runs. `kept`: keys that come with its next answers, the first with the first of them: in one
    breath, or so many seconds `apart`.
    """

    def __init__(
        self,
        words: Sequence[str],
        kind: Kind,
        *,
        late: float = 0.0,
        env: Mapping[str, str] | None = None,
    ) -> None:
        self.kind, self.late = kind, late
        self.asked: list[str] = []  # the questions so far
        self.kept: list[str] = []
        self.apart = 0.0
        self._answers = ""
        self._alternate = False
        # of both screens; the last is on
        self.pushed: dict[bool, list[int]] = {False: [], True: []}
        self._rest = b""
        super().__init__(words, env=env)

    @property
    def flags(self) -> int:
        """The keyboard flags that are on."""
        return self._current[-1] if self._current else 0

    @property
    def flags_left(self) -> dict[bool, list[int]]:
        """The flags pushed and not popped, of the main screen (False) and of the alternate one
        (True).
        """
        return {screen: flags for screen, flags in self.pushed.items() if flags}

    def down(self, code: int) -> None:
        """Press a key, reported as this kind of terminal does."""
        self.type(event(code) if self.kind.keyboard else chr(code))

    def up(self, code: int) -> None:
        """Release a key; only some terminals report that."""
        if self.kind.keyboard:
            self.release(code)

    def press(self, code: int, modifiers: int = 0, *, shifted: int = 0, base: int = 0) -> None:
        """Press a key, on a terminal that was asked to report releases."""
        self.type(event(code, modifiers, shifted=shifted, base=base))

    def repeat(self, code: int, modifiers: int = 0) -> None:
        """Repeat a key that is held."""
        self.type(event(code, modifiers, REPEAT))

    def release(self, code: int, modifiers: int = 0, *, shifted: int = 0, base: int = 0) -> None:
        """Release a key."""
        self.type(event(code, modifiers, RELEASE, shifted=shifted, base=base))

    def received(self, data: bytes) -> None:
        """Answer what was written to the terminal."""
        self._rest = (self._rest + data)[-10_000:]
        end = 0
        for question in QUESTION.finditer(self._rest):
            end = question.end()
            self._hear(question[1].decode(), question[2].decode(), question[3].decode())
        self._rest = self._rest[end:]
        if self._answers:
            answers, self._answers = self._answers, ""
            self._send(answers, self.kept.pop(0) if self.kept else "")

    @property
    def _current(self) -> list[int]:
        return self.pushed[self._alternate]

    def _hear(self, mark: str, numbers: str, final: str) -> None:
        if (mark, numbers) == ("?", "1049"):
            self._alternate = final == "h"
        if final == "u" and mark and self.kind.keyboard:
            self._keyboard(mark, int(numbers.partition(";")[0] or 0))
        elif final == "c" and not mark and self.kind.device:
            self._answer("CSI c", self.kind.device)
        elif final == "n" and numbers == "5" and self.kind.alive:
            self._answer("CSI 5 n", self.kind.alive)

    def _keyboard(self, mark: str, number: int) -> None:
        if mark == "?":
            self._answer("CSI ? u", f"\x1b[?{self.flags}u")
        elif mark == ">":
            self._current.append(number)
        elif mark == "<":
            del self._current[-max(1, number) :]
        elif self._current:
            self._current[-1] = number
        else:
            self._current.append(number)

    def _answer(self, question: str, answer: str) -> None:
        self.asked.append(question)
        self._answers += answer

    def _send(self, answers: str, keys: str) -> None:
        if self.late:
            timer = threading.Timer(self.late, self._type, [answers, keys])
            timer.daemon = True
            timer.start()
        else:
            self._type(answers, keys)

    def _type(self, answers: str, keys: str) -> None:
        if self.apart and keys:
            self._type(answers, "")
            time.sleep(self.apart)
            self._type(keys, "")
        elif not self.closed:
            self.type(answers + keys)


def event(
    code: int, modifiers: int = 0, kind: int = PRESS, *, shifted: int = 0, base: int = 0
) -> str:
    """A key as kitty reports it with all flags, without the parts that are not needed."""
    codes = (
        f"{code}:{shifted or ''}:{base}" if base else f"{code}:{shifted}" if shifted else f"{code}"
    )
    suffix = f":{kind}" if kind != PRESS else ""
    return f"\x1b[{codes};{modifiers + 1}{suffix}u" if modifiers or suffix else f"\x1b[{codes}u"
