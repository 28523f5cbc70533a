"""In tmux and screen the teleop drives; detached or with its window closed, a robot that is latched
stands.
"""

import contextlib
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Terminal, Wire, wait_for
from holozen.testing.wire import command
from tests.integration.robots import Robot

from .motion import Since, assert_nothing_moves, press_until, stands

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
        """Another window onto the same program."""
        return Terminal([*self._tmux, "attach"], env=self.env)

    def shown(self) -> str:
        """What the program shows now, or nothing if that cannot be read."""
        return subprocess.run(
            [*self._tmux, "capture-pane", "-p"], capture_output=True, text=True
        ).stdout

    def end(self) -> None:
        """End it and everything that runs in it."""
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
        subprocess.run(
            ["screen", "-S", "it", "-X", "quit"], env=os.environ | self.env, capture_output=True
        )


@pytest.fixture(
    params=[
        pytest.param(Multiplexer, id="tmux", marks=pytest.mark.needs("tmux")),
        pytest.param(Screen, id="screen", marks=pytest.mark.needs("screen")),
    ]
)
def multiplexer(request: pytest.FixtureRequest, folder: Path) -> Iterator[Multiplexer]:
    made = request.param(folder)
    yield made
    made.end()


@pytest.fixture
def windows() -> Iterator[contextlib.ExitStack]:
    """The windows of a test; they are closed with it."""
    with contextlib.ExitStack() as windows:
        yield windows


def drive(window: Terminal, robot: Robot, key: str, x: float = 0.0, y: float = 0.0) -> None:
    since = Since(robot.odom)
    press_until(lambda: since.drove(x, y), lambda: window.type(key), lambda: None, window.screen)


def test_a_latched_robot_stands_when_its_operator_is_lost_and_waits_for_a_new_key(
    multiplexer: Multiplexer, windows: contextlib.ExitStack, town: Wire, robot: Robot
) -> None:
    words = command("teleop", "--mode", "latch", "--speed", str(V), *town.flags)
    window = windows.enter_context(multiplexer.new(words))
    for leave in (lambda window: window.type(multiplexer.detach), Terminal.hang_up):
        window.wait_for_text("listening sim")
        drive(window, robot, "i", x=V)
        leave(window)
        stands(robot)
        if shown := multiplexer.shown():
            wait_for(lambda: "terminal detached: hands off" in multiplexer.shown(), what=shown)
        window = windows.enter_context(multiplexer.attach())
        window.wait_for_text("listening sim")
        assert_nothing_moves(robot)
        drive(window, robot, "J", y=V)
        window.type("k")
        stands(robot)
    window.type("\x03")
    assert window.process.wait() == 0


def test_a_latched_robot_stands_while_the_line_to_its_operator_hangs(
    multiplexer: Multiplexer, windows: contextlib.ExitStack, town: Wire, robot: Robot
) -> None:
    """tmux and screen go on answering; the operator's window is a suspended process of theirs."""
    window = windows.enter_context(
        multiplexer.new(command("teleop", "--mode", "latch", *town.flags))
    )
    window.wait_for_text("listening sim")
    drive(window, robot, "i", x=0.5)
    window.process.signal(signal.SIGSTOP)
    try:
        stands(robot)
        assert_nothing_moves(robot)
    finally:
        window.process.signal(signal.SIGCONT)
    # The second where the multiplexer itself answered too late, the third where odom did, the last
    # where the teleop was held up.
    reasons = ("press it again", "press a key to drive", "press a key again to drive", "paused:")
    wait_for(
        lambda: any(reason in window.screen() for reason in reasons),
        what=lambda: f"either in {window.screen()}",
    )
    drive(window, robot, "i", x=0.5)
    window.type("\x03")
    assert window.process.wait() == 0


def test_a_key_drives_while_it_repeats_and_a_paste_moves_nothing(
    multiplexer: Multiplexer, windows: contextlib.ExitStack, town: Wire, robot: Robot
) -> None:
    window = windows.enter_context(
        multiplexer.new(command("teleop", "--speed", str(V), *town.flags))
    )
    window.wait_for_text("listening sim")
    commands = robot.commands.from_now()
    window.type("\x1b[200~iiii\x1b[201~")
    press_until(  # what follows the paste was read
        lambda: "0.360 m/s" in window.screen(),
        lambda: window.type("x"),
        lambda: None,
        window.screen,
    )
    robot.newest()
    assert [(r.source, r.message) for r in commands.all()] == []
    since = Since(robot.odom)
    press_until(
        lambda: since.drove(x=0.9 * V), lambda: window.hold("i", 0.7), lambda: None, window.screen
    )
    stands(robot)
