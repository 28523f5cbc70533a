"""The doctor asks the terminal what it can do, and leaves it as it was."""

import pytest

from holozen.testing import Wire, wait_for
from holozen.testing.wire import command

from .played import DUMB, KITTY, TMUX, XTERM, Kind, Played


def told(wire: Wire, kind: Kind, **env: str) -> str:
    """What the doctor says in a terminal, its lines joined."""
    with Played(command("doctor", *wire.flags), kind, env=env) as terminal:
        assert terminal.process.wait(20) in (0, 1)
        wait_for(lambda: " odom: " in terminal.raw)
        assert terminal.modes() == terminal.modes_before
        assert terminal.flags_left == {}
        return terminal.raw


@pytest.mark.parametrize(
    ("kind", "env", "text"),
    [
        (KITTY, {}, "it tells when a key is let go (Kitty protocol)"),
        (XTERM, {}, "it does not tell when a key is let go"),
        (TMUX, {"TMUX": "/tmp/none,1,0"}, "tmux does not tell when a key is let go"),
        (DUMB, {}, "it answers no question"),
    ],
    ids=["kitty", "xterm", "tmux", "dumb"],
)
def test_it_tells_what_the_keyboard_does(wire: Wire, kind: Kind, env: dict[str, str], text: str) -> None:
    shown = told(wire, kind, **env)
    assert text in shown
    assert "100 columns, 32 rows" in shown


def test_it_tells_of_colours_and_encodings_that_lack(wire: Wire) -> None:
    shown = told(wire, XTERM, TERM="dumb", LANG="C", LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
    assert "TERM is 'dumb'" in shown
    assert "PYTHONUTF8=1" in shown
    assert "no colour" in told(wire, XTERM, NO_COLOR="1")
    assert "16 million colours" in told(wire, XTERM, COLORTERM="truecolor")
