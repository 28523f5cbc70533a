"""Flags that are written in the plainest way, read without argparse, whose loading takes longer than the reading.

It takes the same calls as a parser. Whatever is not plain, or wrong, it leaves to argparse, which tells what is wrong.
"""

from __future__ import annotations

from types import SimpleNamespace

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


class NotPlain(Exception):
    """Something that only argparse understands."""


class Flag:
    """One of the calls of `add_argument`."""

    def __init__(self, names: tuple[str, ...], action: str = "store", **options: Any) -> None:
        self.names, self.action = names, action
        self.nargs, self.choices = options.get("nargs"), options.get("choices")
        self.type: Callable[[str], Any] = options.get("type") or str
        long = next((name for name in names if name.startswith("--")), names[0])
        self.dest: str = options.get("dest") or long.lstrip("-").replace("-", "_")
        self.default = options.get("default", False if action == "store_true" else None)
        odd = set(options) - {"nargs", "choices", "type", "dest", "default", "help", "metavar"}
        if (
            odd
            or action not in ("store", "store_true", "append")
            or (isinstance(self.default, str) and self.type is not str)
        ):
            raise NotPlain

    def value(self, text: str) -> Any:
        """What a word stands for."""
        try:
            value = self.type(text)
        except Exception:  # whatever it is, argparse will meet it again and tell
            raise NotPlain from None
        if self.choices is not None and value not in self.choices:
            raise NotPlain
        return value


class Quick:
    """The flags of one verb."""

    def __init__(self) -> None:
        self._flags: dict[str, Flag] = {}
        self._words: list[Flag] = []
        self._defaults: dict[str, Any] = {}

    def set_defaults(self, **defaults: Any) -> None:
        """As of argparse."""
        self._defaults |= defaults

    def add_argument_group(self, *_about: str) -> Quick:
        """As of argparse; a group is for the help alone."""
        return self

    def add_argument(self, *names: str, **options: Any) -> None:
        """As of argparse. Raises NotPlain."""
        flag = Flag(names, **options)
        if names[0].startswith("-"):
            self._flags |= dict.fromkeys(names, flag)
        else:
            self._words.append(flag)

    def parse(self, words: list[str]) -> SimpleNamespace:
        """What argparse would make of the words of a command line. Raises NotPlain."""
        values = {flag.dest: flag.default for flag in (*self._words, *self._flags.values())} | self._defaults
        plain: list[str] = []  # what is no flag
        runs, left = 0, iter(words)
        within = False
        for word in left:
            if not word.startswith("-"):
                runs += not within
                within = True
                plain.append(word)
                continue
            within = False
            flag = self._flags.get(word)
            if flag is None or flag.nargs is not None:
                raise NotPlain
            if flag.action == "store_true":
                values[flag.dest] = True
                continue
            text = next(left, "-")
            if text.startswith("-"):  # a number below zero, or a value that is missing
                raise NotPlain
            value = flag.value(text)
            values[flag.dest] = [*(values[flag.dest] or []), value] if flag.action == "append" else value
        if runs > 1:
            raise NotPlain
        return SimpleNamespace(**values | self._places(plain))

    def _places(self, plain: list[str]) -> dict[str, Any]:
        """The words that are no flags, each in its place; only the last place may take none or several."""
        found: dict[str, Any] = {}
        for flag in self._words:
            last = flag is self._words[-1]
            if flag.nargs is None and plain:
                found[flag.dest] = flag.value(plain.pop(0))
            elif last and flag.nargs in ("*", "+") and plain:
                found[flag.dest] = [flag.value(word) for word in plain]
                plain = []
            elif last and flag.nargs == "*" and flag.default is None:
                found[flag.dest] = []
            elif last and flag.nargs == "?":
                if plain:
                    found[flag.dest] = flag.value(plain.pop(0))
            else:
                raise NotPlain
        if plain:
            raise NotPlain
        return found


def parsed(fill: Callable[[Any], object], words: list[str]) -> Any:
    """What the words of a command line say, by a parser that `fill` adds its flags to; None where that is not plain."""
    quick = Quick()
    try:
        fill(quick)
        return quick.parse(words)
    except NotPlain:
        return None
