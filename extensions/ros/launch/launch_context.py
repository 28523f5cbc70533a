"""LaunchContext: the state of a launch, and the substitutions that are evaluated in it."""

import os
import sys
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from pathlib import Path
from typing import Any, Protocol, Self

from msgspec import Struct, field
from msgspec.structs import astuple, replace

import holozen
from holozen.console import Failure

_OURS = tuple(f"{folder}{os.sep}" for folder in holozen.__path__)
_TRUE, _FALSE = ("true", "1", "yes", "on"), ("false", "0", "no", "off")


class LaunchError(Failure):
    """An error in a launch file. One line; `place` is the file and line."""

    def __init__(self, message: str, place: str = "") -> None:
        super().__init__(message)
        self.place = place

    @classmethod
    def of(cls, error: Failure, place: str) -> "LaunchError":
        """An error with a place, unless it has one."""
        return error if isinstance(error, LaunchError) and error.place else cls(str(error), place)

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.place, super().__str__())))


class Program(Struct, frozen=True):
    """A process to start. `required`: the launch ends with it. `respawn`: seconds until it is
    restarted.
    """

    name: str
    words: Sequence[str]
    cwd: str | None = None
    environment: dict[str, str] = {}
    shell: bool = False
    required: bool = False
    respawn: float | None = None


class Runner(Protocol):
    """What executes a launch: processes, timers and event handlers."""

    def start(self, action: Any, program: Program) -> None: ...
    def skip(self, action: Any, ends: bool) -> None: ...
    def lack(self, action: Any, name: str, why: str) -> None: ...
    def after(self, seconds: float, actions: Sequence[Any]) -> object: ...
    def cancel(self, timer: object) -> None: ...
    def postpone(self, action: Any) -> bool: ...
    def register(self, handler: Any) -> None: ...
    def unregister(self, handler: Any) -> None: ...
    def stop(self, reason: str) -> None: ...


class Scope(Struct):
    """The state that a group of actions has for itself, and the launch files it is in."""

    configurations: dict[str, str] = {}
    environment: dict[str, str] = field(default_factory=lambda: dict(os.environ))
    namespace: str = ""
    parameters: list[Any] = []
    remappings: list[tuple[str, str]] = []
    files: tuple[Path, ...] = ()

    def copy(self) -> "Scope":
        """A copy, whose changes do not affect this one."""
        return Scope(*map(copy, astuple(self)))

    def within(self, file: Path) -> "Scope":
        """The same state inside an included file, which may change it."""
        return replace(self, files=(*self.files, file))


class LaunchContext:
    """The state of a launch. `flags` are Zenoh's, for every process of ours."""

    def __init__(
        self, runner: Runner | None = None, flags: Sequence[str] = (), argv: Sequence[str] = ()
    ) -> None:
        self._runner, self.flags, self.argv = runner, list(flags), list(argv)
        self.scope = Scope()
        self.descriptions: dict[str, str] = {}
        """The robots that robot_state_publisher would publish, by topic."""
        self.temporary_files: list[Path] = []
        self.used: set[str] = set()
        """The launch arguments that were used."""
        self.strict = False
        """Whether a node that cannot run here is an error."""
        self.simulates = False
        self.other_sim: Callable[[], str] = lambda: ""
        """Returns the source of a sim that runs already, or an empty text."""

    @property
    def runner(self) -> Runner:
        """What executes the launch. Raises LaunchError if the launch file is only inspected."""
        if self._runner is None:
            raise LaunchError("nothing can be started here")
        return self._runner

    @property
    def launch_configurations(self) -> dict[str, str]:
        """The values of the launch arguments."""
        return self.scope.configurations

    @property
    def environment(self) -> dict[str, str]:
        """The environment of processes started from here on."""
        return self.scope.environment

    @property
    def file(self) -> Path:
        """The current launch file. Raises LaunchError if there is none."""
        if not self.scope.files:
            raise LaunchError("there is no launch file here")
        return self.scope.files[-1]

    def perform_substitution(self, substitution: Any) -> str:
        """The text of a substitution. Raises LaunchError."""
        return text(self, substitution)

    def full_name(self, name: str, namespace: str = "") -> str:
        """A name with all its namespaces, without a leading slash."""
        if name.startswith("/"):
            return name.strip("/")
        outer = "" if namespace.startswith("/") else self.scope.namespace
        return "/".join(filter(None, (part.strip("/") for part in (outer, namespace, name))))


class Substitution:
    """A text that is evaluated when the launch file is executed; `place` is the file and line where
    it is written.
    """

    place: str

    def __new__(cls, *_args: Any, **_options: Any) -> Self:
        made = super().__new__(cls)
        made.place = here()
        return made

    def perform(self, context: LaunchContext) -> str:
        """The text. Raises LaunchError."""
        try:
            return self._text(context)
        except Failure as error:
            raise LaunchError.of(error, self.place) from None

    def _text(self, context: LaunchContext) -> str:
        """The text; may raise any Failure."""
        raise LaunchError(f"{type(self).__name__} has no text")

    def describe(self) -> str:
        """How it is shown before it is evaluated."""
        return type(self).__name__


Text = Any
"""A str, a path, a Substitution, or a list of them to concatenate (ROS calls it
SomeSubstitutionsType).
"""


def text(context: LaunchContext, value: Text) -> str:
    """The current value of a text. Raises LaunchError."""
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    if isinstance(value, Substitution):
        return value.perform(context)
    if isinstance(value, Iterable):
        return "".join(text(context, part) for part in value)
    raise LaunchError(f"{value!r} is not a text; write a str, a substitution, or a list of both")


def describe(value: Text) -> str:
    """A text as it can be shown before it is evaluated."""
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    if isinstance(value, Substitution):
        return f"<{value.describe()}>"
    return "".join(map(describe, value)) if isinstance(value, Iterable) else str(value)


def truth(context: LaunchContext, value: Any, what: str) -> bool:
    """The truth value of a text. Raises LaunchError."""
    word = str(value) if isinstance(value, bool | int) else text(context, value)
    if word.strip().lower() not in (*_TRUE, *_FALSE):
        raise LaunchError(f"{what} is {word!r}; it must be true or false")
    return word.strip().lower() in _TRUE


def number(context: LaunchContext, value: Any, what: str) -> float:
    """The number in a text, which must not be negative. Raises LaunchError."""
    word = str(value) if isinstance(value, int | float) else text(context, value)
    try:
        found = float(word)
    except ValueError:
        found = -1.0
    if not 0.0 <= found < 1e9:
        raise LaunchError(f"{what} is {word!r}; it must be a number from 0 up")
    return found


def pairs(value: Any, what: str, place: str) -> list[tuple[Any, Any]]:
    """A dict or a list of pairs as a list of pairs. Raises LaunchError for anything else."""
    found = list(value.items() if hasattr(value, "items") else value or ())
    if any(
        isinstance(each, str) or not isinstance(each, list | tuple) or len(each) != 2
        for each in found
    ):
        raise LaunchError(
            f"{what}={value!r:.80} is not a list of pairs; write [('cmd_vel', '/drive')]", place
        )
    return [(each[0], each[1]) for each in found]


def here() -> str:
    """The file and line of the user's code that is being executed; empty where none is."""
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OURS):
        frame = frame.f_back
    name = frame.f_code.co_filename
    return "" if name.startswith("<frozen ") else f"{name}:{frame.f_lineno}"
