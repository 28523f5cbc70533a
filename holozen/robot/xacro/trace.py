"""Follows the xacro library through the files: where it is, who called whom, and when it is too much."""

import json
import os
import re
import signal
from typing import Any

from holozen.robot.errors import RobotError, near
from holozen.robot.tag import MOST_ELEMENTS
from holozen.robot.xacro.lines import Place, place_of

STEP_TIME = 1.2  # s of processor time for one expression or element, then the kernel ends the process
MOST_CALLS = 5_000  # of macros, blocks and includes; the library takes 1 s for as many, and ever longer for more
# Other values in every process: hashes of text, the order of sets, and names that are made up.
_IMPURE = re.compile(r"\b(hash|set|frozenset|anon)\b")


class Trace:
    """Wraps the library's functions. `note` is a file in which the parent finds where a killed child was."""

    def __init__(self, library: Any, note: int) -> None:
        self.library, self.note = library, note
        self.calls: list[str] = []  # macros and includes that are open, outermost first
        self.place: Place | None = None
        self.pure = True
        self._element: Any = None
        self._elements = self._calls = 0
        self._wrap()

    def quiet(self) -> None:
        """No step is under way: the time limit of a step does not count."""
        signal.setitimer(signal.ITIMER_PROF, 0)
        self._note("")

    def _wrap(self) -> None:
        library = self.library
        for name in ("check_attrs", "reqd_attrs"):
            setattr(library, name, self._entering(getattr(library, name)))
        library.handle_macro_call = self._calling(library.handle_macro_call)
        library.process_include = self._including(library.process_include)
        for name in ("safe_eval", "eval_extension"):
            setattr(library, name, self._evaluating(getattr(library, name)))
        library.warning, library.print_location = self._warn, lambda: None

    def _warn(self, *words: object, **_options: object) -> None:
        text = " ".join(" ".join(map(str, words)).split())
        print(f"{self._here()}{text}")

    def _enter(self, node: Any) -> None:
        if node is self._element:
            return
        self._element, self.place = node, place_of(node) or self.place
        self._elements += 1
        if self._elements > MOST_ELEMENTS:
            raise RobotError(f"{self._here()}it expands without end; at most {MOST_ELEMENTS} elements are expanded")
        if node.nodeName == "xacro:insert_block":
            self._count_call()
        self._step("")

    def _step(self, expression: str) -> None:
        self._note(expression)
        signal.setitimer(signal.ITIMER_PROF, STEP_TIME)

    def _note(self, expression: str) -> None:
        file, line = self.place or ("", 0)
        os.pwrite(self.note, json.dumps([file, line, expression[:200]]).encode() + b"\n", 0)

    def _here(self) -> str:
        return f"{self.place}: " if self.place else ""

    def _call(self, node: Any, told: str) -> None:
        self._enter(node)
        self.calls.append(f"{told} {self.place}" if self.place else told)
        self._count_call()

    def _count_call(self) -> None:
        self._calls += 1
        if self._calls > MOST_CALLS:
            raise RobotError(
                f"{self._here()}macros, blocks and includes call each other without end;"
                f" at most {MOST_CALLS} calls are made"
            )

    def _entering(self, function: Any) -> Any:
        def wrapped(node: Any, *rest: Any) -> Any:
            self._enter(node)
            return function(node, *rest)

        return wrapped

    def _calling(self, function: Any) -> Any:
        def wrapped(node: Any, macros: Any, symbols: Any) -> Any:
            name = node.tagName
            if not name.startswith("xacro:") or name == "xacro:call":
                self._enter(node)
                return function(node, macros, symbols)
            depth, place = len(self.calls), place_of(node)
            self._call(node, f"in macro {name[6:]!r} called at")
            try:
                done = function(node, macros, symbols)
            except self.library.XacroException as error:
                self._mend_call(error, node, macros, depth)
                raise
            del self.calls[depth:]
            self._element, self.place = node, place or self.place
            return done

        return wrapped

    def _mend_call(self, error: Any, node: Any, macros: Any, depth: int) -> None:
        """A call that did not get as far as the macro's body is wrong itself, not inside the macro."""
        words = str(error)
        unknown = words.startswith("unknown macro name:")
        if self._element is not node or not (unknown or error.macros):
            return
        del self.calls[depth:]
        if unknown:
            error.hint = near(node.tagName[6:], names(macros))
            return
        params = [param.lstrip("*") for param in error.macros[0].params]
        wrong = words.split('"')[1] if words.startswith("Invalid parameter ") else ""
        error.hint = near(wrong, params) or f"; {node.tagName} takes {', '.join(params) or 'no parameter'}"

    def _including(self, function: Any) -> Any:
        def wrapped(node: Any, *rest: Any) -> None:
            depth, place = len(self.calls), place_of(node)
            self._call(node, "included at")
            try:
                function(node, *rest)
            except self.library.XacroException as error:
                if self._element is node and isinstance(error.exc, OSError):
                    del self.calls[depth:]  # a file that is not there was not included
                raise
            del self.calls[depth:]
            self._element, self.place = node, place or self.place

        return wrapped

    def _evaluating(self, function: Any) -> Any:
        def wrapped(text: str, *tables: Any) -> Any:
            self._step(text)
            self.pure = self.pure and not _IMPURE.search(text)
            try:
                return function(text, *tables)
            except NameError as error:
                if error.name and tables and not hasattr(error, "hint"):
                    error.hint = near(error.name, names(tables[0]))  # type: ignore[attr-defined]
                raise

        return wrapped


def names(table: Any) -> list[str]:
    """The names in one of the library's tables and in those around it."""
    found: list[str] = []
    while isinstance(table, dict):
        found += [str(name).lstrip("*") for name in list(table) if not str(name).startswith("__")]
        table = getattr(table, "parent", None)
    return found
