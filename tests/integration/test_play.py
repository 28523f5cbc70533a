"""scripts/play: an empty world, a robot under a name, keys in the terminal, and nothing left
afterwards.
"""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen import entities
from holozen.testing import Terminal, Wire, wait_for

from .processes import parts_at, wait_for_none
from .robots import Robot, speeds

REPO = Path(__file__).parents[2]


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A tree as this one, in which scripts/venv has nothing to set up."""
    (tmp_path / "house" / "scripts").mkdir(parents=True)
    (tmp_path / "temporary").mkdir()
    house = tmp_path / "house"
    for name in ("urdf", "worlds", "meshes", ".venv"):
        (house / name).symlink_to(REPO / name)
    (house / "scripts" / "play").write_text((REPO / "scripts" / "play").read_text())
    (house / "scripts" / "venv").write_text("#!/bin/sh\n")
    for name in ("play", "venv"):
        (house / "scripts" / name).chmod(0o755)
    return house


@pytest.fixture
def temporary(house: Path) -> Path:
    """Where mktemp makes its folders."""
    return house.parent / "temporary"


class Game:
    """A terminal in which scripts/play runs."""

    def __init__(self, house: Path, wire: Wire, *words: str) -> None:
        self.wire, self.temporary = wire, house.parent / "temporary"
        command = [str(house / "scripts" / "play"), *words, "--", *wire.flags]
        self.terminal = Terminal(command, env={"TMPDIR": str(self.temporary)})

    def left(self) -> tuple[dict[str, int], list[str]]:
        """What still runs, and what still lies there."""
        return parts_at(self.wire), os.listdir(self.temporary)


@pytest.fixture
def game(house: Path, wire: Wire) -> Iterator[Game]:
    game = Game(house, wire)
    yield game
    game.terminal.close()


def played(game: Game, name: str = "Fred") -> Robot:
    """The robot, once the teleop drives it."""
    robot = Robot(game.wire.bus(), name)
    game.terminal.wait_for_text("listening sim")
    game.terminal.hold_until("i", lambda: speeds(robot.newest())[0] > 0.1)
    return robot


def test_fred_drives_in_an_empty_world_and_quitting_leaves_nothing_and_the_terminal_as_it_was(
    game: Game,
) -> None:
    played(game)
    assert entities.names(game.wire.bus()) == ["Fred"]
    game.terminal.type("\x03")
    game.terminal.process.wait()
    assert game.left() == ({}, [])
    assert game.terminal.modes() == game.terminal.modes_before


def test_another_sim_on_the_same_keys_is_reported_and_a_signal_ends_all_of_it(
    house: Path, game: Game
) -> None:
    robot = played(game)
    before, temporary = game.left()
    other = Game(house, game.wire)
    other.terminal.process.wait(30)
    assert other.terminal.process.returncode == 1
    assert "simulates here already" in other.terminal.raw
    assert game.left() == (before, temporary) and before
    other.terminal.close()
    assert game.terminal.process.terminate() == 128 + signal.SIGTERM
    wait_for_none(game.wire)
    wait_for(lambda: game.left() == ({}, []))
    robot.wait_for_stop_command()


def test_a_closed_terminal_ends_all_of_it(game: Game) -> None:
    robot = played(game)
    game.terminal.hang_up()
    assert game.terminal.process.wait() == 128 + signal.SIGHUP
    wait_for_none(game.wire)
    wait_for(lambda: game.left() == ({}, []))
    robot.wait_for_stop_command()


@pytest.mark.needs("setpriv")
def test_another_robot_plays_under_another_name_and_killed_it_leaves_nothing_running(
    house: Path, wire: Wire
) -> None:
    game = Game(house, wire, str(REPO / "urdf" / "rover.urdf.xacro"), "Rosie")
    try:
        played(game, "Rosie")
        game.terminal.process.kill()
        wait_for_none(game.wire)
    finally:
        game.terminal.close()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["no/such.xacro"], "no/such.xacro"),
        (["urdf/wheely_boi.xacro", "bad name"], "bad name"),
        (["--help"], "use scripts/play [FILE] [NAME]"),
    ],
    ids=str,
)
def test_an_error_is_reported_and_leaves_nothing_behind(
    house: Path, wire: Wire, words: list[str], expected: str
) -> None:
    game = Game(
        house, wire, *(str(house / word) if word.startswith("urdf") else word for word in words)
    )
    game.terminal.process.wait(30)
    assert game.terminal.process.returncode in (1, 2)
    wait_for(lambda: expected in game.terminal.raw)
    assert game.left() == ({}, [])
    game.terminal.close()


def test_without_a_terminal_it_reports_that(house: Path, temporary: Path) -> None:
    play = subprocess.run(
        [house / "scripts" / "play"], stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    assert play.returncode == 2
    assert len(play.stderr.splitlines()) == 1
    assert "needs a terminal" in play.stderr
    assert list(temporary.iterdir()) == []
