"""The flags together with the settings file, and what they forbid."""

from pathlib import Path
from typing import Any

import pytest

from holozen.messages import Twist
from holozen.testing import Wire, wait_for
from services.teleop.__main__ import latches, main, only_robot, parser
from services.teleop.settings import parse


def test_keys_latch_unless_a_closer_setting_is_hold(tmp_path: Path) -> None:
    for text, words, latch in [
        ("", [], False),
        ("", ["--mode", "client"], False),
        ('mode = "latch"', ["--mode", "client"], True),
        ('mode = "latch"', ["--mode", "hold"], False),
        ("key_timeout = 0", [], True),
        ("key_timeout = 0", ["--mode", "hold"], False),
        ("key_timeout = 0", ["--key-timeout", "0.5"], False),
    ]:
        file = tmp_path / "teleop.toml"
        file.write_text(text)
        assert latches(parse(parser(), words, str(file))) is latch


def test_without_a_name_the_only_robot_is_driven_if_it_has_a_name(wire: Wire) -> None:
    bus = wire.bus("teleop")
    keys = dict[str, Any]()
    for added, found in [("Fred", ["Fred"]), ("Ann", []), ("", [])]:
        key = f"{added}/cmd_vel" if added else "cmd_vel"
        keys[key] = wire.bus("sim").subscribe(key, Twist)
        wait_for(lambda: {*keys} <= {end.key for end in bus.endpoints()})
        assert only_robot(bus) == found


@pytest.mark.parametrize("words", [["--script", "x"], ["--mode", "latch"], ["--key-timeout", "0"]])
def test_a_dead_man_without_held_keys_is_refused(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--deadman", *words]) == 2
    assert capsys.readouterr().err.startswith("teleop: --deadman needs keys that are held")


def test_a_script_for_several_robots_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bot1", "bot999", "--script", "no/such/file"]) == 2
    assert (
        capsys.readouterr().err
        == "teleop: a script drives one robot, so name one of bot1, bot999\n"
    )
