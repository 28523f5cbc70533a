"""What holds while a launch file is followed: its arguments, the environment, the namespace."""

import os
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from holozen.ros.launch.text import LaunchError, Text, text

if TYPE_CHECKING:
    from holozen.ros.launch.entity import Action, Entities


@dataclass(frozen=True, slots=True)
class Program:
    """A process to start. `required`: the launch ends with it. `respawn`: seconds until it is started again."""

    name: str
    words: Sequence[str]
    cwd: str | None = None
    environment: dict[str, str] = field(default_factory=dict)
    shell: bool = False
    required: bool = False
    respawn: float | None = None


class Stage(Protocol):
    """Where things happen: processes, timers, and what is done when they end."""

    def start(self, action: "Action", program: Program) -> None: ...
    def left_out(self, action: "Action", ends: bool) -> None: ...
    def after(self, seconds: float, actions: "Entities") -> object: ...
    def cancel(self, timer: object) -> None: ...
    def last(self, action: "Action") -> bool: ...
    def handle(self, handler: Any) -> None: ...
    def unhandle(self, handler: Any) -> None: ...
    def stop(self, reason: str) -> None: ...


@dataclass(slots=True)
class Scope:
    """What a group of actions has for itself, and the launch file that they are in."""

    configurations: dict[str, str] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=lambda: dict(os.environ))
    namespace: str = ""
    parameters: list[Any] = field(default_factory=list)
    remappings: list[tuple[str, str]] = field(default_factory=list)
    files: tuple[Path, ...] = ()

    def copy(self) -> "Scope":
        """The same, for changes of its own."""
        return Scope(*(copy(getattr(self, name)) for name in Scope.__slots__))

    def within(self, file: Path) -> "Scope":
        """The same, in a file that this one includes: changes of its arguments are seen here too."""
        return replace(self, files=(*self.files, file))


class LaunchContext:
    """The state of a launch. `flags` are Zenoh's, for every process of ours."""

    def __init__(self, stage: Stage | None = None, flags: Sequence[str] = (), argv: Sequence[str] = ()) -> None:
        self._stage, self.flags, self.argv = stage, list(flags), list(argv)
        self.scope = Scope()
        self.descriptions: dict[str, str] = {}
        """By topic, the robots that robot_state_publisher would tell."""
        self.origins: dict[str, list[str]] = {}
        """By text, the file that xacro made it from, and its name:=value words."""
        self.made: list[Path] = []
        """Files to be deleted at the end."""
        self.used: set[str] = set()
        """The launch arguments that something has asked for."""
        self.simulates = False

    @property
    def stage(self) -> Stage:
        """Where processes and timers are. LaunchError if the launch file is only looked at."""
        if self._stage is None:
            raise LaunchError("nothing can be started here")
        return self._stage

    @property
    def launch_configurations(self) -> dict[str, str]:
        """The values of the launch arguments."""
        return self.scope.configurations

    @property
    def environment(self) -> dict[str, str]:
        """The environment of the processes to come."""
        return self.scope.environment

    @property
    def file(self) -> Path:
        """The launch file at hand. LaunchError if there is none."""
        if not self.scope.files:
            raise LaunchError("there is no launch file here")
        return self.scope.files[-1]

    def perform_substitution(self, substitution: Text) -> str:
        """The text of a substitution. Raises LaunchError."""
        return text(self, substitution)

    def full_name(self, name: str, namespace: str = "") -> str:
        """A name with the namespaces before it, without a slash at the front."""
        if name.startswith("/"):
            return name.strip("/")
        outer = "" if namespace.startswith("/") else self.scope.namespace
        return "/".join(filter(None, (part.strip("/") for part in (outer, namespace, name))))
