"""A robot whose file asks for it slows down towards what its lidar sees, touches nothing, and says
why.
"""

import math
import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace

from holozen.command.arbiter import PERSON
from holozen.limits import STOP, Planar
from holozen.messages import LaserScan
from holozen.robot.files.loading import parse
from holozen.robot.files.sdf_world import load_world
from holozen.robot.model import RobotModel
from holozen.testing import Wire
from services.sim.entities import Entities
from services.sim.loop import Loop
from services.sim.parameters import declared
from services.sim.physics.engine import UPRIGHT
from services.sim.physics.world import World
from services.sim.robot import Robot
from services.sim.scene import Scene
from services.sim.spawn import add_models

REPO = Path(__file__).parents[3]
RADIUS = 0.25  # m
STEP = 1 / 120  # s
REMIND = 12  # steps after which a person's keys are sent again
ROUND = """
<robot name="round">
  <link name="base">
    <inertial><origin xyz="0 0 0.1"/><mass value="5"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.25" length="0.3"/></geometry>
    </collision>
  </link>
  <gazebo><plugin name="p" filename="libgazebo_ros_planar_move.so">{tags}</plugin></gazebo>
  <gazebo reference="base"><sensor name="lidar" type="ray">
    <pose>0 0 0.1 0 0 0</pose><update_rate>{rate}</update_rate>
    <ray><scan><horizontal><samples>{rays}</samples><min_angle>-3.14159</min_angle><max_angle>3.14159</max_angle>
    </horizontal></scan><range><min>0.1</min><max>10</max></range>
    <noise><type>gaussian</type><mean>0</mean><stddev>0.01</stddev></noise></ray>
    <plugin name="l" filename="libgazebo_ros_laser.so"><topicName>scan</topicName></plugin>
  </sensor></gazebo>
</robot>
"""
ON = "<time_before_collision>1.2</time_before_collision>"


def model(tags: str = ON, rate: float = 10, rays: int = 180) -> RobotModel:
    return parse(ROUND.format(tags=tags, rate=rate, rays=rays), Path("round.urdf"))


class Ride:
    """A robot in a world, which a person drives as fast as the processor allows."""

    def __init__(self, wire: Wire, world: World, robot: RobotModel) -> None:
        self.bus = wire.bus("sim")
        self.entities = Entities(self.bus, world, (5.0, 10.0))
        add_models(self.entities, world.spec.models)
        entity = self.entities.add("Fred", robot, ((0.0, 0.0, 0.0), UPRIGHT))
        assert entity.robot is not None
        self.robot: Robot = entity.robot
        self.entities.set_start()
        self.scene = Scene(world, self.entities)
        self.loop = Loop(self.bus, world, self.entities, 0.0)
        self.loop.run(threading.Event(), 120)  # until it stands

    def drive(
        self, velocity: Planar, seconds: float, each: Callable[[], None] | None = None
    ) -> None:
        """Hold keys for a time of the sim. `each` is called ten times a second."""
        arbiter = self.robot.commands.arbiters.base
        for _ in range(round(seconds / (STEP * REMIND))):
            arbiter.offer("person", PERSON, velocity, time.monotonic())
            self.loop.run(threading.Event(), REMIND)
            if each:
                each()

    @property
    def at(self) -> tuple[float, float]:
        """Its place."""
        x, y, _ = self.robot.body.pose()[0]
        return x, y

    @property
    def limited(self) -> str:
        """What its status says."""
        return self.robot.status(time.monotonic()).limited

    def touched(self) -> set[str]:
        """What it touches, besides the ground."""
        touches = self.scene.look().touches("Fred", "base")
        return {touch.other[0] for touch in touches} - {"ground_plane"}


@pytest.fixture
def arena(engine: str) -> Iterator[World]:
    """The arena without its ramp: a lidar sees neither an edge below it nor a way up."""
    spec = load_world(REPO / "worlds" / "arena.world")
    models = tuple(one for one in spec.models if one.name != "ramp")
    flat = replace(spec, models=models, step=STEP)
    with closing(World(flat, engine)) as world:
        yield world


WALL = """<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include>
<model name="wall"><static>true</static><pose>2.5 0 0.5 0 0 0</pose><link name="l">
<collision name="c"><geometry><box><size>1 8 1</size></box></geometry></collision></link></model>
</world></sdf>"""


@pytest.fixture
def wall(engine: str, tmp_path: Path) -> Iterator[World]:
    """A wall at x = 2."""
    file = tmp_path / "wall.world"
    file.write_text(WALL)
    with closing(World(replace(load_world(file), step=STEP), engine)) as world:
        yield world


def test_random_drives_of_a_person_in_the_arena_touch_nothing(
    wire: Wire, arena: World, trials: Callable[[int, int], int]
) -> None:
    ride, chance = Ride(wire, arena, model()), random.Random(42)
    touched, driven, limited = set[str](), 0.0, 0

    def look() -> None:
        nonlocal limited
        touched.update(ride.touched())
        limited += bool(ride.limited)

    drives = trials(48, 1200)
    for _ in range(drives):
        x, y, turn = (chance.choice((-1, 0, 1)) for _ in range(3))
        speed, before = chance.choice((0.15, 0.5, 1.0, 2.0)), ride.at
        ride.drive((x * speed, y * speed, turn * 1.0), chance.uniform(0.3, 1.5), look)
        driven += math.dist(before, ride.at)
    assert touched == set()
    assert driven > 0.2 * drives and limited > drives, "it came near things"


@pytest.mark.engines
def test_it_stops_before_a_wall_says_so_and_one_may_turn_and_drive_away(
    wire: Wire, wall: World
) -> None:
    ride, words = Ride(wire, wall, model()), list[str]()
    ride.drive((1.0, 0.0, 0.0), 8.0, lambda: words.append(ride.limited))
    assert 2.0 - 0.1 - 0.1 < ride.at[0] + RADIUS < 2.0 - 0.07
    assert [word for word in words if word.startswith("slowed: 0.4 m ahead")]
    assert words[-1] == "stopped: 0.1 m ahead"
    stood = ride.at
    ride.drive((0.0, 0.0, 1.0), math.pi / 2)
    assert ride.limited == ""
    ride.drive((0.0, -0.5, 0.0), 1.0)
    assert ride.limited == "stopped: 0.1 m to the right"
    assert math.dist(stood, ride.at) < 0.02
    ride.drive((0.0, 0.5, 0.0), 1.0)
    assert ride.limited == ""
    assert ride.at[0] == pytest.approx(stood[0] - 0.5, abs=0.05)
    ride.drive(STOP, 0.1)
    assert ride.limited == ""


@pytest.mark.parametrize("tags", ["", "<timeBeforeCollision>0</timeBeforeCollision>"])
def test_without_the_tag_it_drives_into_the_wall_and_by_a_parameter_it_does_not(
    wire: Wire, wall: World, tags: str
) -> None:
    ride = Ride(wire, wall, model(tags))
    ride.drive((1.0, 0.0, 0.0), 3.0)
    assert (ride.touched(), ride.limited) == ({"wall"}, "")
    ride.drive((-1.0, 0.0, 0.0), 2.0)
    parameters = {one.name: one for one in declared(ride.entities, ride.loop.pace)}
    switch = parameters["Fred.time_before_collision"]
    assert switch.read() == 0.0
    assert switch.write is not None
    switch.write(1.2)
    ride.drive((1.0, 0.0, 0.0), 8.0)
    assert (ride.touched(), ride.limited) == (set(), "stopped: 0.1 m ahead")
    switch.write(0.0)
    ride.drive((1.0, 0.0, 0.0), 1.0)
    assert (ride.touched(), ride.limited) == ({"wall"}, "")


def test_a_scan_that_comes_too_seldom_stops_it_until_the_next_one(wire: Wire, wall: World) -> None:
    ride, words = Ride(wire, wall, model(rate=1)), list[str]()
    ride.drive((-0.5, 0.0, 0.0), 4.0, lambda: words.append(ride.limited))
    assert {"", "stopped: the scan is 0.7 s old"} < set(words)
    assert ride.at[0] == pytest.approx(-1.0, abs=0.2), "it drove half of the time"


def test_a_blind_lidar_stops_it(wire: Wire, wall: World) -> None:
    ride = Ride(wire, wall, model())
    monitor = ride.robot.monitor
    assert monitor is not None
    see = monitor.see

    def blind(key: str, scan: LaserScan, age: float = 0.0) -> None:
        see(key, replace(scan, ranges=[math.nan] * len(scan.ranges)), age)

    monitor.see = blind  # type: ignore[method-assign, assignment]
    ride.drive((-0.5, 0.0, 0.5), 1.0)
    assert ride.limited == "stopped: the scan is blind: none of its ranges is valid"
    at = ride.at
    ride.drive((-0.5, 0.0, 0.5), 1.0)
    assert math.dist(ride.at, at) < 0.01
    monitor.see = see  # type: ignore[method-assign]
    ride.drive((-0.5, 0.0, 0.5), 1.0)
    assert (ride.limited, math.dist(ride.at, at) > 0.2) == ("", True)


def test_after_a_reset_it_drives_by_new_scans_alone(wire: Wire, wall: World) -> None:
    ride = Ride(wire, wall, model())
    ride.drive((1.0, 0.0, 0.0), 1.0)
    ride.loop.simulation.reset(0, time.monotonic())
    assert ride.robot.monitor is not None
    assert ride.robot.monitor.limit((0.1, 0.0, 0.0), 0.0) == STOP
    assert ride.robot.monitor.reason == "stopped: no scan has come yet"
