"""Worlds from SDF files: what stands in them stands there, and robots push it, climb it, and stop at it."""

from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import simulation_interfaces as si
from holozen.testing import Process, Wire

from .conftest import start_sim
from .robots import Robot, distance, moves, place

REPO = Path(__file__).parents[2]
ARENA = str(REPO / "worlds" / "arena.world")
DISC = """<robot name="disc"><link name="base">
  <inertial><origin xyz="0 0 0.02"/><mass value="20"/><inertia ixx="0.2" iyy="0.2" izz="0.4"/></inertial>
  <collision><origin xyz="0 0 0.06"/><geometry><box size="0.3 0.3 0.1"/></geometry></collision>
  <collision><origin xyz="0.1 0 0.06"/><geometry><sphere radius="0.06"/></geometry></collision>
  <collision><origin xyz="-0.1 0 0.06"/><geometry><sphere radius="0.06"/></geometry></collision>
</link></robot>"""


@pytest.fixture
def disc(tmp_path: Path) -> str:
    """A small heavy robot that is moved as a whole."""
    (tmp_path / "disc.urdf").write_text(DISC)
    return str(tmp_path / "disc.urdf")


def arena(wire: Wire, robot: str) -> Process:
    return start_sim(wire, "--world", ARENA, "--robot", robot, "--drive", "planar_move", "--rtf", "4")


def where(bus: Bus, name: str) -> tuple[float, float, float]:
    state = bus.call("get_entity_state", si.GetEntityStateRequest(name), si.GetEntityStateReply).state
    return state.pose.position.x, state.pose.position.y, state.pose.position.z


def test_the_arena_holds_what_its_file_says_and_the_robot(wire: Wire, disc: str) -> None:
    arena(wire, disc)
    names = wire.bus().call("get_entities", si.GetEntitiesRequest(), si.GetEntitiesReply).entities
    assert {"walls", "ramp", "crate", "ball", "disc"} <= set(names)


def test_a_wall_stops_a_robot_that_drives_on(wire: Wire, disc: str) -> None:
    arena(wire, disc)
    robot = Robot(wire.bus()).wait_longer()
    robot.drive(0, -1.5, until=lambda odom: place(odom)[1] < -3.8)
    begin = len(robot.odom.messages())
    robot.drive(0, -1.5, until=lambda _: len(robot.odom.messages()) > begin + 40)
    assert all(place(odom)[1] > -3.9 for odom in robot.odom.messages()[begin:])
    robot.stop()


def test_a_robot_pushes_a_crate(wire: Wire, disc: str) -> None:
    arena(wire, disc)
    bus = wire.bus()
    robot = Robot(bus).wait_longer()
    before = where(bus, "ball")
    robot.drive(0, -1, until=lambda odom: place(odom)[1] < before[1] + 0.02)
    robot.drive(-1, 0, until=lambda odom: place(odom)[0] < before[0] - 0.3)
    robot.put()
    robot.odom.next(lambda odom: moves(odom, 0, 0, 0))  # what it pushed may still touch it
    assert where(bus, "ball")[0] < before[0] - 0.1


def test_a_robot_climbs_the_ramp(wire: Wire, disc: str) -> None:
    arena(wire, disc)
    bus = wire.bus()
    robot = Robot(bus).wait_longer()
    x = where(bus, "ramp")[0]
    robot.drive(0, 1, until=lambda odom: place(odom)[1] > 2.5)  # to its foot, not to the edge at its side
    robot.drive(1, 0, until=lambda odom: place(odom)[0] > x)
    robot.drive(0, -0.5, until=lambda odom: odom.pose.pose.position.z > 0.15 or place(odom)[1] < -1)
    robot.put()
    stood = robot.odom.next(lambda odom: moves(odom, 0, 0, 0))
    assert stood.pose.pose.position.z > 0.1
    assert distance(stood, robot.pass_time(2)) < 0.01  # it does not creep down again
