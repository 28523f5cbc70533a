"""What is told to people is one line that their terminal survives."""

import sys

import pytest

from holozen.tell import printable, say


def test_a_line_is_told_on_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    say("sim: ready")
    assert capsys.readouterr() == ("", "sim: ready\n")


def test_what_came_over_the_wire_cannot_move_the_cursor_or_start_a_line() -> None:
    assert printable("cmd_vel: from \x1b[2Jme\nand\ryou") == "cmd_vel: from ?[2Jme?and?you"
    assert printable("grün ▶ 10 °") == "grün ▶ 10 °"


def test_say_tells_only_what_is_printable(capsys: pytest.CaptureFixture[str]) -> None:
    say("one\ntwo")
    assert capsys.readouterr().err == "one?two\n"


def test_a_terminal_that_is_gone_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone:
        def write(self, _text: str) -> int:
            raise OSError("gone")

    monkeypatch.setattr(sys, "stderr", Gone())
    say("anybody?")
