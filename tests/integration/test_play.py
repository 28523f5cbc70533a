"""scripts/play: an empty world, a robot under a name, keys in the terminal, and nothing left afterwards."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen import entities
from holozen.testing import Terminal, Wire, wait_for

from .conftest import start_sim
from .processes import parts_at
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
    game.terminal.type("i")
    robot.odom.next(lambda odom: speeds(odom)[0] > 0.1)
    return robot


def test_fred_drives_in_an_empty_world_and_quitting_leaves_nothing_and_the_terminal_as_it_was(game: Game) -> None:
    played(game)
    assert entities.names(game.wire.bus()) == ["Fred"]
    game.terminal.type("\x03")
    game.terminal.process.wait()
    assert game.left() == ({}, [])
    assert game.terminal.modes() == game.terminal.modes_before


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP], ids=lambda n: n.name)
def test_a_signal_ends_all_of_it(game: Game, number: int) -> None:
    robot = played(game)
    game.terminal.process.signal(number)
    assert game.terminal.process.wait() == 128 + number
    wait_for(lambda: game.left() == ({}, []))
    robot.wait_for_stop_command()


def test_a_closed_terminal_ends_all_of_it(game: Game) -> None:
    played(game)
    game.terminal.hang_up()
    game.terminal.process.wait()
    wait_for(lambda: game.left() == ({}, []))


@pytest.mark.needs("setpriv")
def test_killed_it_leaves_nothing_running(game: Game) -> None:
    played(game)
    game.terminal.process.kill()
    wait_for(lambda: game.left()[0] == {})


def test_another_robot_plays_under_another_name(house: Path, wire: Wire) -> None:
    game = Game(house, wire, str(REPO / "urdf" / "rover.urdf.xacro"), "Rosie")
    try:
        played(game, "Rosie")
    finally:
        game.terminal.close()


def test_another_sim_on_the_same_keys_is_reported(house: Path, wire: Wire) -> None:
    start_sim(wire)
    game = Game(house, wire)
    game.terminal.process.wait(30)
    assert game.terminal.process.returncode == 1
    assert "simulates here already" in game.terminal.raw
    assert set(parts_at(wire)) == {"sim"}
    assert game.left()[1] == []
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
    game = Game(house, wire, *(str(house / word) if word.startswith("urdf") else word for word in words))
    game.terminal.process.wait(30)
    assert game.terminal.process.returncode in (1, 2)
    wait_for(lambda: expected in game.terminal.raw)
    assert game.left() == ({}, [])
    game.terminal.close()


def test_without_a_terminal_it_reports_that(house: Path, temporary: Path) -> None:
    play = subprocess.run([house / "scripts" / "play"], stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert play.returncode == 2
    assert len(play.stderr.splitlines()) == 1
    assert "needs a terminal" in play.stderr
    assert list(temporary.iterdir()) == []
