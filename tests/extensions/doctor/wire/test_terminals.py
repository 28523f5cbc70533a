"""The doctor asks the terminal what it can do, and leaves it as it was."""

import pytest

from holozen.testing import Wire, wait_for
from holozen.testing.wire import command
from tests.terminals.played import DUMB, KITTY, TMUX, XTERM, Kind, Played


def reported(wire: Wire, kind: Kind, **env: str) -> str:
    """The doctor's output in a terminal, with its lines joined."""
    with Played(command("doctor", *wire.flags), kind, env=env) as terminal:
        assert terminal.process.wait() in (0, 1)
        wait_for(lambda: " odom: " in terminal.raw)
        assert terminal.modes() == terminal.modes_before
        assert terminal.flags_left == {}
        return terminal.raw


@pytest.mark.parametrize(
    ("kind", "env", "text"),
    [
        (KITTY, {}, "this terminal reports key releases (Kitty protocol)"),
        (XTERM, {}, "this terminal does not report key releases"),
        (TMUX, {"TMUX": "/tmp/none,1,0"}, "tmux does not report key releases"),
        (DUMB, {}, "this terminal does not answer"),
    ],
    ids=["kitty", "xterm", "tmux", "dumb"],
)
def test_it_shows_what_the_keyboard_does(
    wire: Wire, kind: Kind, env: dict[str, str], text: str
) -> None:
    shown = reported(wire, kind, **env)
    assert text in shown


def test_an_encoding_without_pictures_is_reported(wire: Wire) -> None:
    assert "PYTHONUTF8=1" in reported(
        wire, XTERM, LANG="C", LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0"
    )
