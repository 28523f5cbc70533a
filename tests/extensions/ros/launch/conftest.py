"""A stage on which nothing is started: what would be is kept."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from holozen.console import Failure
from holozen.ros.launch import stand_ins
from holozen.ros.launch.launch_context import LaunchContext, LaunchError, Program
from holozen.ros.launch.launch_description import Entities, LaunchDescription

Follow = Callable[..., "Kept"]


class Kept:
    """What a launch file did: the programs, in order."""

    def __init__(self, values: dict[str, str], path: Path) -> None:
        self.context = LaunchContext(self, ["--wire", "cdr"])
        self.context.scope = self.context.scope.within(path)
        self.context.scope.configurations.update(values)
        self.programs: list[Program] = []
        self.left: list[tuple[Any, bool]] = []
        self.lacking: list[str] = []
        self.timers: list[tuple[float, Entities]] = []
        self.handlers: list[Any] = []
        self.reason = ""
        self.postponed: list[Any] = []

    def follow(self, entities: Any) -> None:
        """Execute the entities, each with the scope that it has."""
        scope = self.context.scope
        for entity in entities:
            self.context.scope = scope
            try:
                found = entity.visit(self.context)
            except Failure as error:
                raise LaunchError.of(error, entity.place) from None
            self.follow(found)

    def start(self, _action: Any, program: Program) -> None:
        self.programs.append(program)

    def skip(self, action: Any, ends: bool) -> None:
        self.left.append((action, ends))

    def lack(self, _action: Any, name: str, why: str) -> None:
        self.lacking.append(f"{name}: {why}")

    def after(self, seconds: float, actions: Entities) -> object:
        self.timers.append((seconds, actions))
        return self.timers[-1]

    def cancel(self, timer: Any) -> None:
        self.timers.remove(timer)

    def postpone(self, action: Any) -> bool:
        if action in self.postponed:
            return False
        self.postponed.append(action)
        return True

    def register(self, handler: Any) -> None:
        self.handlers.append(handler)

    def unregister(self, handler: Any) -> None:
        self.handlers.remove(handler)

    def stop(self, reason: str) -> None:
        self.reason = reason

    def words(self, number: int = 0) -> list[str]:
        """Those of a program of ours from its verb on, without packages and connection."""
        found = list(self.programs[number].words)
        assert found[1:3] == ["-m", "holozen"], found
        for flag in ("--package", "--wire"):
            while flag in found:
                at = found.index(flag)
                del found[at : at + 2]
        return found[3:]


def gone(pid: int) -> bool:
    """Whether a process has ended; its parent may not have read how."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.fixture
def follow(my_bot: Path) -> Iterator[Follow]:
    """`follow([actions], name="value")`: what they do in a launch file of my_bot, with values of
    its arguments.
    """
    stand_ins.replace_gazebo_packages()
    made: list[Path] = []

    def follow(actions: list[Any], **values: str) -> Kept:
        kept = Kept(values, my_bot / "launch" / "a.launch.py")
        kept.context.temporary_files = made
        kept.follow([LaunchDescription(actions)])
        kept.follow(list(kept.postponed))
        return kept

    yield follow
    for path in made:
        path.unlink(missing_ok=True)
