"""Reads small hand-written TOML files. Errors in them, and in all other input of the teleop, are
one line.
"""

import os
import re
import stat
from typing import Any

from holozen.console import printable
from holozen.suggest import shorten, suggest

LARGEST = 64 * 1024  # bytes
MAX_LINE = 1000  # characters in a line; a long dotted key keeps tomllib busy for many seconds
_PLACE = re.compile(r"(.*) \(at (?:line (\d+), column \d+|end of document)\)", re.DOTALL)


class InputError(ValueError):
    """A file or an argument that cannot be used; the text is one printable line with the place and
    the reason.
    """

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


def read(path: str) -> dict[str, Any]:
    """The contents of the file, unchecked. Raises InputError. It never blocks, not even on a
    FIFO.
    """
    import tomllib  # most runs do not need it

    try:
        text = _bytes(path).decode()
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start})") from None
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > MAX_LINE:
            raise InputError(f"{path}:{number}: is longer than {MAX_LINE} characters")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{path}: is nested too deeply") from None
    except ValueError as error:
        raise InputError(_not_toml(path, text, str(error))) from None


def cut(value: object) -> str:
    """A value as text for a message: its repr, shortened."""
    return shorten(repr(value), 60)


def one_of(name: str, known: list[str]) -> str:
    """The end of a message about an unknown name: the closest known one, or all of them if none is
    close.
    """
    return suggest(name, known) or f"; use {', '.join(known)}"


def _bytes(path: str) -> bytes:
    try:
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(number, "rb") as file:
            is_file, found = stat.S_ISREG(os.fstat(number).st_mode), file.read(LARGEST + 1)
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder") from None
    except (OSError, ValueError) as error:  # a path with a NUL in it is a ValueError
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if not is_file:
        raise InputError(f"{path}: is not a regular file")
    if len(found) > LARGEST:
        raise InputError(f"{path}: is larger than {LARGEST // 1024} KB")
    return found


def _not_toml(path: str, text: str, reason: str) -> str:
    match = _PLACE.fullmatch(reason)
    if not match:
        return f"{path}: is not TOML: {reason}"
    lines = text.rstrip().split("\n")
    number = int(match[2] or len(lines))
    return f"{path}:{number}: is not TOML: {match[1]}: {cut(lines[number - 1].strip())}"
