"""A parser of flags that tells what is wrong in one line and starts fast."""

from __future__ import annotations

import argparse
import os
import sys

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    from typing import Any, NoReturn

WIDTH = 100  # characters of a line of help where there is no terminal


class Formatter(argparse.HelpFormatter):
    """Help as wide as the terminal. argparse's own way to find that out loads shutil, and so takes 3 ms."""

    def __init__(self, prog: str) -> None:
        try:
            width = os.get_terminal_size().columns
        except OSError:
            width = WIDTH
        super().__init__(prog, width=max(40, min(width, 120)), max_help_position=30)


class Parser(argparse.ArgumentParser):
    """A parser that tells a mistake in one line, with the closest right word."""

    def __init__(self, **options: Any) -> None:
        self._words: list[str] = []  # what is parsed
        super().__init__(**{"formatter_class": Formatter, **options})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does, which all its other ways to parse go through."""
        self._words = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and end with exit code 2."""
        from holozen.flags import nearest
        from holozen.tell import say

        verbs = [action.choices for action in self._actions if isinstance(action, argparse._SubParsersAction)]
        for choices in verbs:
            if self._words and self._words[0] in choices:
                choices[self._words[0]].error(message)  # whose flags they are
        before, _, left = message.partition("unrecognized arguments: ")
        if left and not before:
            message = f"{left!r} is too much"
        if not verbs and (flag := self._unknown_flag(message, [] if before else left.split())):
            message = f"no flag {flag!r}{nearest(flag, self._option_string_actions)}"
        say(f"{self.prog}: {message}; `{self.prog} --help` shows how")
        raise SystemExit(2)

    def _unknown_flag(self, message: str, left: list[str]) -> str:
        """The flag that there is not: the first that was `left`, or one whose value is what `message` complains of, or
        whose place something else should have.
        """
        place = "are required: " in message
        for word, value in [(word, word) for word in left] or zip(self._words, [*self._words[1:], ""], strict=False):
            flag = word.partition("=")[0]
            unknown = flag[:1] == "-" and not any(name.startswith(flag) for name in self._option_string_actions)
            if unknown and (left or place or repr(value) in message):
                return flag
        return ""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            from holozen.flags import nearest

            words = [str(choice) for choice in action.choices]
            raise argparse.ArgumentError(action, f"{value!r}{nearest(value, words)}; there are {', '.join(words)}")
