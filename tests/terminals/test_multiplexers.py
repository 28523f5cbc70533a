"""In tmux and screen the teleop drives; detached or with its window closed, a robot that is latched stands."""

import contextlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Terminal, Wire, wait_for
from holozen.testing.wire import command
from tests.integration.robots import Robot, moves

from .motion import assert_nothing_moves

V = 0.4  # m/s


class Multiplexer:
    """tmux or screen, on a socket of its own in `folder`."""

    detach = "\x02d"

    def __init__(self, folder: Path) -> None:
        self._tmux = ["tmux", "-S", str(folder / "socket"), "-f", "/dev/null"]
        self.env: dict[str, str] = {}

    def new(self, words: list[str]) -> Terminal:
        """A window in which a program runs in it."""
        return Terminal([*self._tmux, "new-session", *words], env=self.env)

    def attach(self) -> Terminal:
        """Another window that looks at the same program."""
        return Terminal([*self._tmux, "attach"], env=self.env)

    def shown(self) -> str:
        """What the program shows now, whoever looks; empty if that cannot be read."""
        return subprocess.run([*self._tmux, "capture-pane", "-p"], capture_output=True, text=True).stdout

    def end(self) -> None:
        """End it and all that runs in it."""
        subprocess.run([*self._tmux, "kill-server"], capture_output=True)


class Screen(Multiplexer):
    """GNU screen."""

    detach = "\x01d"

    def __init__(self, folder: Path) -> None:
        folder.chmod(0o700)  # it insists
        self.env = {"SCREENDIR": str(folder)}

    def new(self, words: list[str]) -> Terminal:
        return Terminal(["screen", "-c", "/dev/null", "-S", "it", *words], env=self.env)

    def attach(self) -> Terminal:
        return Terminal(["screen", "-c", "/dev/null", "-r", "it"], env=self.env)

    def shown(self) -> str:
        return ""

    def end(self) -> None:
        subprocess.run(["screen", "-S", "it", "-X", "quit"], env=os.environ | self.env, capture_output=True)


@pytest.fixture(params=[
    pytest.param(Multiplexer, id="tmux", marks=pytest.mark.needs("tmux")),
    pytest.param(Screen, id="screen", marks=pytest.mark.needs("screen")),
])  # fmt: skip
def multiplexer(request: pytest.FixtureRequest, folder: Path) -> Iterator[Multiplexer]:
    made = request.param(folder)
    yield made
    made.end()


@pytest.fixture
def windows() -> Iterator[contextlib.ExitStack]:
    """The windows of a test; they are closed with it."""
    with contextlib.ExitStack() as windows:
        yield windows


@pytest.mark.parametrize("way", ["detached", "closed"])
def test_a_latched_robot_stands_when_nobody_is_there_and_waits_for_a_key_of_who_comes_back(
    multiplexer: Multiplexer, windows: contextlib.ExitStack, town: Wire, robot: Robot, way: str
) -> None:
    words = command("teleop", "--mode", "latch", "--speed", str(V), *town.flags)
    first = windows.enter_context(multiplexer.new(words))
    first.wait_for_text("listening sim")
    first.type("i")
    robot.odom.next(lambda odom: moves(odom, V, 0, 0))
    if way == "detached":
        first.type(multiplexer.detach)
    else:
        first.hang_up()
    robot.told_to_stop()
    robot.stands()
    if shown := multiplexer.shown():
        wait_for(lambda: "terminal detached: hands off" in multiplexer.shown(), what=shown)
    second = windows.enter_context(multiplexer.attach())
    second.wait_for_text("listening sim")
    assert_nothing_moves(robot)
    second.type("J")
    robot.odom.next(lambda odom: moves(odom, 0, V, 0))
    second.type("k")
    robot.stands()
    second.type("\x03")
    assert second.process.wait() == 0
    robot.told_to_stop()


def test_a_key_drives_while_it_repeats(
    multiplexer: Multiplexer, windows: contextlib.ExitStack, town: Wire, robot: Robot
) -> None:
    window = windows.enter_context(multiplexer.new(command("teleop", "--speed", str(V), *town.flags)))
    window.wait_for_text("listening sim")
    window.hold("i", 1.0)
    robot.odom.next(lambda odom: moves(odom, V, 0, 0))
    robot.told_to_stop()
    robot.stands()


def test_a_paste_moves_nothing(
    multiplexer: Multiplexer, windows: contextlib.ExitStack, town: Wire, robot: Robot
) -> None:
    window = windows.enter_context(multiplexer.new(command("teleop", "--speed", str(V), *town.flags)))
    window.wait_for_text("listening sim")
    seen = len(robot.commands.messages())
    window.type("\x1b[200~iiii\x1b[201~w")
    window.wait_for_text("0.44")
    robot.newest()
    assert [(r.sample.source, r.message) for r in robot.commands.all()[seen:]] == []
