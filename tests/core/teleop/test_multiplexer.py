"""tmux and screen mark in their socket's mode whether anybody is attached."""

import os
from pathlib import Path

import pytest

from services.teleop.input.kitty import Keyboard
from services.teleop.input.terminal import Terminal
from services.teleop.input.terminal_liveness import (
    DETACHED,
    TerminalLiveness,
    attached,
    multiplexer,
)


def test_outside_a_multiplexer_an_operator_is_always_present() -> None:
    assert attached({})()
    assert attached({"TMUX": "/no/such/socket,1,0"})()


def test_a_multiplexer_is_known_by_its_variables_and_over_ssh_by_its_terminal() -> None:
    assert multiplexer({"TMUX": "/tmp/s,1,0", "TERM": "screen-256color"}) == "tmux"
    assert multiplexer({"STY": "1.pts-0"}) == "screen"
    assert multiplexer({"TERM": "tmux-256color"}) == "tmux"
    assert multiplexer({"TERM": "screen"}) == "screen"
    assert multiplexer({"TERM": "xterm-256color", "TMUX": "", "STY": ""}) == ""


@pytest.mark.parametrize("kind", ["tmux", "screen"])
def test_a_detached_multiplexer_has_no_operator_and_its_keys_end_at_once(
    tmp_path: Path, kind: str
) -> None:
    socket = tmp_path / "1234.pts-0"
    socket.touch(0o700)
    message = {
        "tmux": {"TMUX": f"{socket},42,0"},
        "screen": {"STY": socket.name, "SCREENDIR": str(tmp_path)},
    }
    look = attached(message[kind])
    assert look()
    ends = os.openpty()
    liveness = TerminalLiveness(Terminal(fileno=ends[1]), Keyboard())
    liveness.is_attached = look
    assert liveness.check(0.0, engaged=True, lasting=True) == ""
    socket.chmod(0o600)
    assert not look()
    assert liveness.check(0.0, engaged=True, lasting=True) == DETACHED
    assert liveness.check(0.0, engaged=False, lasting=True) == ""
    for end in ends:
        os.close(end)
    socket.chmod(0o700)
    assert look()
    socket.unlink()
    assert not look()
