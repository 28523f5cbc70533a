"""The teleop's settings file: defaults for its flags."""

import argparse
import os
from collections.abc import Mapping

from . import toml_file
from .control.layouts import LAYOUTS
from .toml_file import InputError, cut, one_of

NAMES = (
    "speed",
    "turn",
    "speed_limit",
    "turn_limit",
    "repeat_rate",
    "key_timeout",
    "stamped",
    "frame_id",
    "mode",
    "keys",
    "plain",
    "deadman",
    "joystick",
)
"""The flags that the file may set. Robot and network are given on the command line only."""

MODES = ("hold", "latch")  # the flag also accepts Zenoh's modes, which belong to the network

FLAGS_INSTEAD = "the flags here are --speed, --turn, --robot and those of --help"

Setting = str | int | float | bool


def path(environ: Mapping[str, str] = os.environ) -> str | None:
    """The path of the settings file; None if there is no home folder."""
    folder = environ.get("XDG_CONFIG_HOME", "")
    # must be ignored according to the XDG Base Directory Specification
    if not os.path.isabs(folder):
        home = environ.get("HOME", "")
        folder = os.path.join(home, ".config") if os.path.isabs(home) else ""
    return os.path.join(folder, "holozen", "teleop.toml") if folder else None


def read(path: str | None) -> dict[str, Setting]:
    """The settings in the file, their names and types checked; empty without a file. Raises
    InputError.
    """
    if path is None or not os.path.lexists(path):
        return {}
    found = toml_file.read(path)
    for name, value in found.items():
        if name not in NAMES:
            raise InputError(
                f"{path}: {cut(name)} is unknown{one_of(name.replace('-', '_'), [*NAMES])}"
            )
        if not isinstance(value, Setting):
            raise InputError(
                f"{path}: {name} is {cut(value)}; write one number, true, false or a text in quotes"
            )
    return found


def apply(parser: argparse.ArgumentParser, path: str | None) -> None:
    """Make the file's settings the defaults of the flags, after the flags' own checks. Raises
    InputError.
    """
    actions = {action.dest: action for action in parser._actions if action.option_strings}
    values: dict[str, object] = {}
    for name, value in read(path).items():
        assert path is not None
        if name not in actions:
            raise InputError(f"{path}: {name} is not for this program")
        try:
            values[name] = _checked(actions[name], _from_here(name, value, path))
        except (argparse.ArgumentTypeError, ValueError) as error:
            raise InputError(f"{path}: {name} is {error}") from None
    parser.set_defaults(**values)


def parse(
    parser: argparse.ArgumentParser, words: list[str], path: str | None
) -> argparse.Namespace:
    """Parse flags, with the file's settings as defaults. Raises InputError."""
    for word in words:
        if word == "--ros-args" or (":=" in word and not word.startswith("-")):
            raise InputError(f"{cut(word)} is ROS's; {FLAGS_INSTEAD}")
    parser.parse_args(words)  # first, so that --help and errors in flags do not depend on the file
    apply(parser, path)
    return parser.parse_args(words)


def _from_here(name: str, value: Setting, path: str) -> Setting:
    """Resolve a layout's file relative to the settings file."""
    if name != "keys" or not isinstance(value, str) or value in LAYOUTS:
        return value
    return os.path.join(os.path.dirname(path), os.path.expanduser(value))


def _checked(action: argparse.Action, value: Setting) -> object:
    """The value as the flag converts it. Raises ArgumentTypeError or ValueError."""
    if action.nargs == 0:  # a flag that takes no value
        if not isinstance(value, bool):
            raise ValueError(f"{cut(value)}: write true or false")
        return value
    if isinstance(value, bool):
        if action.nargs != "?":
            raise ValueError(f"{str(value).lower()}: it needs a value")
        return action.const if value else action.default
    made = action.type(str(value)) if callable(action.type) else str(value)
    choices = MODES if action.dest == "mode" else action.choices
    if choices is not None and made not in choices:
        raise ValueError(f"{cut(value)}{one_of(str(value), [str(choice) for choice in choices])}")
    return made
