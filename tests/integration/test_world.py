"""Worlds from SDF files: what stands in them stands there, and robots push it, climb it, and stop
at it.
"""

from collections.abc import Callable
from pathlib import Path

import pytest

from holozen import entities
from holozen.messages import Odometry
from holozen.testing import LockStep, Wire

from .robots import distance, moves, place

REPO = Path(__file__).parents[2]
ARENA = str(REPO / "worlds" / "arena.world")
DISC = """<robot name="disc"><link name="base">
  <inertial><origin xyz="0 0 0.02"/><mass value="20"/><inertia ixx="0.2" iyy="0.2" izz="0.4"/></inertial>
  <collision><origin xyz="0 0 0.06"/><geometry><box size="0.3 0.3 0.1"/></geometry></collision>
  <collision><origin xyz="0.1 0 0.06"/><geometry><sphere radius="0.06"/></geometry></collision>
  <collision><origin xyz="-0.1 0 0.06"/><geometry><sphere radius="0.06"/></geometry></collision>
</link></robot>"""  # noqa: E501


@pytest.fixture(scope="module")
def shared(town: Wire, tmp_path_factory: pytest.TempPathFactory) -> LockStep:
    """The arena, and a small heavy robot in it that is moved as a whole."""
    file = tmp_path_factory.mktemp("disc") / "disc.urdf"
    file.write_text(DISC)
    return LockStep(town, "--world", ARENA, "--robot", str(file), "--drive", "planar_move")


@pytest.fixture
def arena(shared: LockStep) -> LockStep:
    shared.reset()
    return shared


def where(arena: LockStep, name: str) -> tuple[float, float, float]:
    position = entities.pose(arena.bus, name).position
    return position.x, position.y, position.z


def drive(arena: LockStep, x: float, y: float, until: Callable[[Odometry], bool]) -> None:
    """Command until odom is so; at most for 10 s."""
    for _ in range(100):
        arena.drive(x, y)
        if until(arena.step(24)):
            return
    raise AssertionError(f"in 10 s it came to {place(arena.odom)}")


def test_the_arena_holds_the_contents_of_its_file_and_the_robot(arena: LockStep) -> None:
    assert {"walls", "ramp", "crate", "ball", "disc"} <= set(entities.names(arena.bus))


def test_a_wall_stops_a_robot_that_drives_on(arena: LockStep) -> None:
    drive(arena, 0, -1.5, until=lambda odom: place(odom)[1] < -3.8)
    for _ in range(20):
        arena.drive(0, -1.5)
        assert place(arena.step(24))[1] > -3.9


def test_a_robot_pushes_a_ball(arena: LockStep) -> None:
    before = where(arena, "ball")
    drive(arena, 0, -1, until=lambda odom: place(odom)[1] < before[1] + 0.02)
    drive(arena, -1, 0, until=lambda odom: place(odom)[0] < before[0] - 0.3)
    arena.drive()
    assert moves(arena.step(24), 0, 0, 0)  # what it pushed may still touch it
    assert where(arena, "ball")[0] < before[0] - 0.1


def test_a_robot_climbs_the_ramp(arena: LockStep) -> None:
    x = where(arena, "ramp")[0]
    # to its foot, not to the edge at its side
    drive(arena, 0, 1, until=lambda odom: place(odom)[1] > 2.5)
    drive(arena, 1, 0, until=lambda odom: place(odom)[0] > x)
    drive(
        arena, 0, -0.5, until=lambda odom: odom.pose.pose.position.z > 0.15 or place(odom)[1] < -1
    )
    arena.drive()
    stood = arena.step(24)
    assert moves(stood, 0, 0, 0, tolerance=0.01) and stood.pose.pose.position.z > 0.1
    assert distance(stood, arena.step(480)) < 0.002, "it rocks, but it does not creep down again"
