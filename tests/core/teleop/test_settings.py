"""The settings file gives the flags other defaults, after the flags' own checks."""

import argparse
import os
from pathlib import Path

import pytest

from holozen import flags
from services.teleop.settings import NAMES, apply, parse, path, read
from services.teleop.toml_file import InputError


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser()
    add = parser.add_argument
    add("robot", nargs="?", default="")
    add("--robot", dest="robots", action="append")
    add("--name", default="teleop")
    add("--speed", type=flags.number(0, 1000, "m/s"), default=0.5)
    add("--key-timeout", type=flags.number(0, 3600, "s"), default=0.5)
    add("--stamped", action=argparse.BooleanOptionalAction, default=False)
    add("--frame-id", default="")
    add("--mode", choices=("auto", "hold", "latch"), default="auto")
    add("--keys", default="ttk")
    add("--plain", action="store_true")
    add("--joystick", nargs="?", const="", default=None)
    return parser


def written(folder: Path, text: str) -> str:
    (folder / "teleop.toml").write_text(text)
    return str(folder / "teleop.toml")


def given(folder: Path, text: str, *words: str) -> argparse.Namespace:
    return parse(parser(), list(words), written(folder, text))


def refusal(folder: Path, text: str) -> str:
    file = written(folder, text)
    with pytest.raises(InputError) as error:
        apply(parser(), file)
    assert str(error.value).startswith(f"{file}:")
    assert str(error.value).isprintable()
    return str(error.value).removeprefix(file)


def test_the_file_lies_in_the_config_folder_if_there_is_one() -> None:
    for environ, there in [
        ({"XDG_CONFIG_HOME": "/c", "HOME": "/h"}, "/c/holozen/teleop.toml"),
        ({"HOME": "/h"}, "/h/.config/holozen/teleop.toml"),
        ({"XDG_CONFIG_HOME": "", "HOME": "/h"}, "/h/.config/holozen/teleop.toml"),
        ({"XDG_CONFIG_HOME": "relative", "HOME": "/h"}, "/h/.config/holozen/teleop.toml"),
        ({"HOME": ""}, None),
        ({}, None),
    ]:
        assert path(environ) == there


def test_no_file_and_no_folder_set_nothing(tmp_path: Path) -> None:
    assert read(None) == {}
    assert read(str(tmp_path / "none" / "teleop.toml")) == {}
    assert parse(parser(), [], None) == parser().parse_args([])


def test_an_empty_file_sets_nothing(tmp_path: Path) -> None:
    assert given(tmp_path, "# nothing yet\n") == parser().parse_args([])


def test_the_file_sets_what_no_flag_does(tmp_path: Path) -> None:
    text = (
        'speed = 0.9\nkey_timeout = 1\nstamped = true\nframe_id = "base"\nmode = '
        '"latch"\nplain = true\n'
    )
    got = given(tmp_path, text, "--speed", "0.2", "Fred")
    assert (got.speed, got.key_timeout, got.stamped, got.frame_id) == (0.2, 1.0, True, "base")
    assert (got.mode, got.plain, got.robot) == ("latch", True, "Fred")


def test_a_flag_can_take_back_what_the_file_switches_on(tmp_path: Path) -> None:
    assert not given(tmp_path, "stamped = true", "--no-stamped").stamped


@pytest.mark.parametrize("word", ["_speed:=0.3", "cmd_vel:=Fred/cmd_vel", "--ros-args"])
def test_arguments_of_ros_are_answered_with_the_flags(tmp_path: Path, word: str) -> None:
    with pytest.raises(InputError, match="is ROS's; the flags here are --speed, --turn, --robot"):
        given(tmp_path, "", word)


def test_a_joystick_is_any_none_or_one(tmp_path: Path) -> None:
    assert given(tmp_path, "joystick = true").joystick == ""
    assert given(tmp_path, "joystick = false").joystick is None
    assert given(tmp_path, 'joystick = "/dev/input/event7"').joystick == "/dev/input/event7"


def test_a_file_of_keys_is_looked_for_beside_the_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", "/h")
    assert given(tmp_path, 'keys = "mine.toml"').keys == str(tmp_path / "mine.toml")
    assert given(tmp_path, 'keys = "/other/mine.toml"').keys == "/other/mine.toml"
    assert given(tmp_path, 'keys = "~/mine.toml"').keys == "/h/mine.toml"
    assert given(tmp_path, 'keys = "wasd"').keys == "wasd"


def test_a_wrong_file_is_refused_in_one_line(tmp_path: Path) -> None:
    rows = [
        ("sped = 1", ": 'sped' is unknown (did you mean 'speed'?)"),
        ("key-timeout = 1", ": 'key-timeout' is unknown (did you mean 'key_timeout'?)"),
        ('connect = "tcp/1.2.3.4:7447"', f": 'connect' is unknown; use {', '.join(NAMES)}"),
        ('robot = "Fred"', f": 'robot' is unknown; use {', '.join(NAMES)}"),
        ("speed = -1", ": speed is '-1': use a number from 0 to 1000 m/s"),
        ("speed = nan", ": speed is 'nan': use a number from 0 to 1000 m/s"),
        ("speed = 1e400", ": speed is 'inf': use a number from 0 to 1000 m/s"),
        ("speed = true", ": speed is true: it needs a value"),
        ("speed = [1]", ": speed is [1]; write one number, true, false or a text in quotes"),
        ("[speed]", ": speed is {}; write one number, true, false or a text in quotes"),
        (
            "speed = 12:00:00",
            ": speed is datetime.time(12, 0); write one number, true, false or a text in quotes",
        ),
        ('stamped = "yes"', ": stamped is 'yes': write true or false"),
        ("stamped = 1", ": stamped is 1: write true or false"),
        ('mode = "hodl"', ": mode is 'hodl' (did you mean 'hold'?)"),
        ('mode = "auto"', ": mode is 'auto'; use hold, latch"),
        ("deadman = true", ": deadman is not for this program"),
        (
            "speed = 1\nturn 2",
            ":2: is not TOML: Expected '=' after a key in a key/value pair: 'turn 2'",
        ),
        ("speed = 1\nspeed = 2", ":2: is not TOML: Cannot overwrite a value: 'speed = 2'"),
        ("speed =", ":1: is not TOML: Invalid value: 'speed ='"),
        (
            'frame_id = "\x1b[2J',
            ":1: is not TOML: Illegal character '\\x1b': 'frame_id = \"\\x1b[2J'",
        ),
    ]
    for text, words in rows:
        assert refusal(tmp_path, text) == words


def test_wrong_flags_and_help_come_before_a_wrong_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        given(tmp_path, "sped = 1", "--help")
    assert end.value.code == 0
    assert "--key-timeout" in capsys.readouterr().out


def test_what_is_no_file_is_refused_and_never_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for name, words in (
        ("", "is a folder"),
        ("fifo", "is not a regular file"),
        ("loop", "Too many levels"),
    ):
        with pytest.raises(InputError, match=words):
            read(str(tmp_path / name))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"#" * 65537, "is larger than 64 KB"),
        (b"name = '\xff'", r"is not UTF-8 text \(byte 8\)"),
        (b"a = " + b"[\n" * 30000, "is nested too deeply"),
        (b"a = 1\n" + b"a." * 500 + b"a = 1", ":2: is longer than 1000 characters"),
        (b"\0", r":1: is not TOML: Invalid statement: '\\x00'"),
    ],
)
def test_what_no_person_writes_is_refused_too(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "teleop.toml").write_bytes(content)
    with pytest.raises(InputError, match=words) as error:
        read(str(tmp_path / "teleop.toml"))
    assert len(str(error.value)) < 400
