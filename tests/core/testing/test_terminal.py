"""The terminal of holozen.testing: its size, its slowness, keys that are held."""

import sys
from itertools import pairwise

import pytest

from holozen.testing import Terminal, wait_for

SAYS_ITS_SIZE = """
import os, signal
def report(*_):
    columns, rows = os.get_terminal_size()
    os.write(1, f"{columns} by {rows}\\n".encode())
signal.signal(signal.SIGWINCH, report)
report()
while True:
    signal.pause()
"""
ECHOES = "import sys\nfor line in sys.stdin: print(line, flush=True)"


def python(code: str, size: tuple[int, int] = (100, 32)) -> Terminal:
    return Terminal([sys.executable, "-S", "-c", code], size=size)


def test_it_has_the_size_that_was_asked_for_and_takes_another() -> None:
    with python(SAYS_ITS_SIZE, size=(80, 24)) as terminal:
        assert len(terminal.wait_for_text("80 by 24").split("\n")) == 24
        terminal.resize(120, 40)
        assert len(terminal.wait_for_text("120 by 40").split("\n")) == 40


def test_frozen_it_shows_nothing_until_it_is_thawed() -> None:
    with python(ECHOES) as terminal:
        terminal.type("one\n")
        terminal.wait_for_text("one")
        terminal.freeze()
        seen = terminal.raw
        terminal.type("two\n" * 5)
        with pytest.raises(AssertionError):
            wait_for(lambda: terminal.raw.count("two") > 5, within=0.2)
        assert len(terminal.raw) - len(seen) < 40
        terminal.thaw()
        wait_for(lambda: terminal.raw.count("two") == 10)


def test_all_that_a_process_wrote_is_there_when_it_has_ended() -> None:
    with python("print('the end')") as terminal:
        terminal.freeze()
        assert terminal.process.wait() == 0
        terminal.thaw()  # read from now on
        assert terminal.raw == "the end\r\n"


def test_a_key_that_is_held_repeats_after_a_delay() -> None:
    with python(ECHOES) as terminal:
        times = terminal.hold("i", 0.33, delay=0.2, interval=0.05)
        assert len(times) == 4
        assert times[1] - times[0] >= 0.2
        assert all(b >= a for a, b in pairwise(times))
        terminal.wait_for_text("iiii")
