"""Sensors measure what geometry predicts, with the noise of their tags, at their rates in sim
time.
"""

import math
import struct
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from holozen import entities
from holozen.engines import is_installed
from holozen.flags import ENGINES
from holozen.messages import (
    ContactsState,
    Imu,
    LaserScan,
    LinkStates,
    Message,
    ModelStates,
    Odometry,
    PointCloud2,
    Pose,
    Quaternion,
    Range,
)
from holozen.messages.geometry_msgs import Point
from holozen.messages.simulation_interfaces import ResetSimulationRequest as Scope
from holozen.testing import LockStep, Wire, wait_for
from holozen.transport.pubsub import Subscription

Sim = Callable[..., LockStep]
HEIGHT = 0.5  # m; of the lidar above the root
NOISE = 0.02  # m
RAYS = 91  # from -90 to 90 degrees, by 2
FAN = f"<samples>{RAYS}</samples><min_angle>{-math.pi / 2}</min_angle><max_angle>{math.pi / 2}</max_angle>"  # noqa: E501
POSES = Scope.SCOPE_TIME + Scope.SCOPE_STATE
STEPS = 24  # of 1/240 s, of one scan at 10 Hz


def lidar(name: str, noise: float = 0.0, plugin: str = "", fan: str = FAN) -> str:
    tag = (
        f"<noise><type>gaussian</type><mean>0</mean><stddev>{noise}</stddev></noise>"
        if noise
        else ""
    )
    return f"""<sensor type="ray" name="{name}"><update_rate>10</update_rate><ray><scan><horizontal>{fan}</horizontal>
    </scan><range><min>0.1</min><max>8</max></range>{tag}</ray>{plugin}</sensor>"""  # noqa: E501


def plugin(kind: str, tags: str) -> str:
    return f'<plugin name="p" filename="libgazebo_ros_{kind}.so">{tags}</plugin>'


CUBE = """<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.05"/><geometry><box size="0.4 0.4 0.1"/></geometry></collision>"""  # noqa: E501
MAST = """<collision><geometry><box size="0.2 0.2 0.05"/></geometry></collision>"""
ROBOT = f"""<robot name="bot"><link name="base">{CUBE}</link>
<link name="mast">{MAST}</link><joint name="up" type="fixed"><origin xyz="0 0 {HEIGHT}"/><parent link="base"/>
<child link="mast"/></joint>
<gazebo reference="mast">{lidar("clean")}
{lidar("noisy", NOISE, plugin("laser", "<topicName>noisy</topicName>"))}
{lidar("cloud", 0.0, plugin("block_laser", "<topicName>points</topicName>"))}
{lidar("near", 0.0, plugin("range", "<topicName>range</topicName>"))}
<sensor type="contact" name="bumper"><update_rate>10</update_rate><contact><collision>c</collision></contact>
{plugin("bumper", "<ros><remapping>bumper_states:=bumper</remapping></ros><frame_name>mast</frame_name>")}</sensor>
<sensor type="imu" name="imu"><pose>0.1 0 0 0 0 {math.pi / 2}</pose><update_rate>60</update_rate></sensor></gazebo>
<gazebo><plugin name="drive" filename="libgazebo_ros_planar_move.so"><robotBaseFrame>base</robotBaseFrame></plugin>
</gazebo></robot>"""  # noqa: E501
WALL = """<robot name="wall"><link name="wall"><collision><geometry><box size="0.2 20 4"/></geometry></collision></link>
<gazebo><static>true</static></gazebo></robot>"""  # noqa: E501


class Eyes:
    """A robot with sensors in a paused sim, and what came from them since the last look."""

    def __init__(self, sim: LockStep) -> None:
        self.sim, self.bus = sim, sim.bus
        kinds: dict[str, type[Message]] = {
            "scan": LaserScan,
            "noisy": LaserScan,
            "points": PointCloud2,
            "range": Range,
            "imu": Imu,
            "bumper": ContactsState,
        }
        self._read = {key: self.bus.subscribe(key, kind, depth=5000) for key, kind in kinds.items()}

    def after(self, steps: int = STEPS) -> dict[str, list[Any]]:
        """All messages of so many steps: the reply of `step_simulation` follows them on the same
        link. A few steps at a time: of thousands of messages at once a full link drops some.
        """
        self.forget()
        found: dict[str, list[Any]] = {key: [] for key in self._read}
        while steps > 0:
            self.sim.step(min(steps, STEPS))
            steps -= STEPS
            for key, messages in self.forget().items():
                found[key] += messages
        return found

    def forget(self) -> dict[str, list[Any]]:
        return {
            key: [one.message for one in iter(read.try_recv, None)]
            for key, read in self._read.items()
        }

    def wall(self, turned: float = 0.0) -> None:
        """A wall whose face is 2 m ahead of the robot, turned by some degrees about that point."""
        half = math.radians(turned) / 2
        away = (2 + 0.1 * math.cos(2 * half), 0.1 * math.sin(2 * half))
        pose = Pose(
            Point(away[0], away[1], 1.0), Quaternion(0.0, 0.0, math.sin(half), math.cos(half))
        )
        if "wall" in entities.names(self.bus):
            entities.delete(self.bus, "wall")
        entities.spawn(self.bus, "wall", WALL, pose)


@pytest.fixture(scope="module", params=[one for one in ENGINES if is_installed(one)])
def eyes(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Eyes]:
    path = tmp_path_factory.mktemp("robot") / "bot.urdf"
    path.write_text(ROBOT)
    with Wire() as wire:
        yield Eyes(LockStep(wire, "--engine", request.param, "--robot", f"{path}"))


def to_wall(angle: float, turned: float = 0.0) -> float:
    """From the origin, at an angle from x in rad, to a wall through (2, 0) whose normal is turned
    by some degrees.
    """
    normal = math.radians(turned)
    facing = math.cos(angle - normal)
    distance = 2 * math.cos(normal) / facing if facing > 1e-9 else math.inf
    return distance if distance <= 8 else math.inf


def angles(scan: LaserScan) -> list[float]:
    return [scan.angle_min + number * scan.angle_increment for number in range(len(scan.ranges))]


@pytest.mark.parametrize("turned", [0, 30])
def test_a_scan_of_a_wall_is_what_geometry_predicts(eyes: Eyes, turned: int) -> None:
    eyes.wall(turned)
    scan = eyes.after()["scan"][-1]
    assert (len(scan.ranges), scan.header.frame_id, scan.range_max) == (RAYS, "mast", 8)
    assert scan.scan_time == pytest.approx(0.1)
    expected = [to_wall(angle, turned) for angle in angles(scan)]
    assert any(map(math.isinf, expected)), "some rays pass the wall"
    assert scan.ranges == pytest.approx(expected, abs=2e-3)


def test_noise_is_that_of_its_tag_and_the_same_at_the_same_step(eyes: Eyes) -> None:
    eyes.wall()
    eyes.sim.reset(POSES)
    first = eyes.after(40 * STEPS)
    errors = [
        noisy - clean
        for one, other in zip(first["noisy"], first["scan"], strict=True)
        for noisy, clean in zip(one.ranges, other.ranges, strict=True)
        if math.isfinite(clean) and clean < 7.9
    ]
    count = len(errors)
    assert count > 2000
    mean = sum(errors) / count
    deviation = math.sqrt(sum((error - mean) ** 2 for error in errors) / (count - 1))
    assert abs(mean) < 5 * NOISE / math.sqrt(count)
    assert deviation == pytest.approx(NOISE, rel=5 / math.sqrt(2 * count))
    eyes.sim.reset(POSES)
    assert eyes.after(40 * STEPS)["noisy"] == first["noisy"]
    assert first["noisy"][1].ranges != first["noisy"][2].ranges


def test_points_and_range_agree_with_the_scan(eyes: Eyes) -> None:
    eyes.wall(30)
    sent = eyes.after()
    scan, cloud, near = (sent[key][-1] for key in ("scan", "points", "range"))
    hit = [(a, r) for a, r in zip(angles(scan), scan.ranges, strict=True) if math.isfinite(r)]
    assert (cloud.width, cloud.height, [field.name for field in cloud.fields]) == (
        len(hit),
        1,
        ["x", "y", "z"],
    )
    points = struct.iter_unpack("<3f", bytes(cloud.data))
    for (x, y, z), (angle, distance) in zip(points, hit, strict=True):
        assert (x, y, z) == pytest.approx(
            (distance * math.cos(angle), distance * math.sin(angle), 0), abs=1e-5
        )
    assert near.range == pytest.approx(min(scan.ranges))
    assert (near.radiation_type, near.min_range, near.max_range) == (
        Range.INFRARED,
        pytest.approx(0.1),
        8,
    )


def test_a_bumper_reports_what_touches_its_link_and_where(eyes: Eyes) -> None:
    eyes.wall()
    eyes.sim.reset(POSES)
    free = eyes.after()["bumper"][-1]
    assert (free.header.frame_id, free.states) == ("mast", []), "its own robot's links do not count"
    post = WALL.replace("wall", "post").replace("0.2 20 4", "0.2 0.1 4")
    # its face 0.2 m ahead, where the base stops
    entities.spawn(eyes.bus, "post", post, Pose(Point(0.3, 0.05, 2.0)))
    eyes.sim.drive(x=0.2)
    eyes.sim.step(60)
    assert eyes.after()["bumper"][-1].states == [], "the base touches it, the mast does not"
    entities.delete(eyes.bus, "post")
    entities.spawn(eyes.bus, "post", post, Pose(Point(0.3, 0.05, 2.3)))
    eyes.sim.drive(x=0.4)
    eyes.sim.step(3 * STEPS)
    (state,) = eyes.after()["bumper"][-1].states
    assert (state.collision1_name, state.collision2_name) == ("bot::mast", "post::post")
    for point, normal, depth in zip(
        state.contact_positions, state.contact_normals, state.depths, strict=True
    ):
        assert (point.x, normal.x, depth) == pytest.approx((0.1, -1, 0), abs=5e-3), (
            "at the front of the mast"
        )
        assert -0.01 < point.y < 0.11
    entities.delete(eyes.bus, "post")


def test_robots_that_glide_see_and_are_seen_where_they_are(eyes: Eyes) -> None:
    """Planar robots that touch nothing but the ground have no contacts in the engine, and move
    outside of its steps.
    """
    eyes.sim.reset()
    entities.spawn(eyes.bus, "other", ROBOT, Pose(Point(1.5, 0.0)))
    eyes.sim.drive(x=-0.4)
    for steps in (120, 72):
        scan = eyes.after(steps)["scan"][-1]
        assert eyes.sim.status.steps % STEPS == 0, "the last scan is of the last step"
        distance = 1.4 - eyes.sim.odom.pose.pose.position.x  # to the near face of its mast
        assert scan.ranges[RAYS // 2] == pytest.approx(distance, abs=2e-3)
    assert distance > 1.6
    entities.delete(eyes.bus, "other")
    assert eyes.after()["scan"][-1].ranges[RAYS // 2] == math.inf


def test_an_imu_measures_gravity_a_turn_and_the_pull_of_a_circle(eyes: Eyes) -> None:
    eyes.sim.reset()
    eyes.sim.step(60)
    rest = eyes.after(24)["imu"][-1]
    assert rest.header.frame_id == "imu"
    force, turn = rest.linear_acceleration, rest.angular_velocity
    assert (force.x, force.y, force.z) == pytest.approx((0, 0, 9.8), abs=0.01)
    assert (turn.x, turn.y, turn.z) == pytest.approx((0, 0, 0), abs=1e-3)
    assert rest.orientation.yaw() == pytest.approx(math.pi / 2, abs=1e-3), (
        "its pose in the link is turned"
    )
    eyes.sim.drive(turn=2.0)
    spun = eyes.after(60)["imu"][-1]
    # 0.1 m from the axis: w^2 r to the inside, which is -x of the robot and, turned by 90 degrees,
    # y of the sensor.
    assert spun.angular_velocity.z == pytest.approx(2.0, abs=1e-3)
    assert spun.linear_acceleration.y == pytest.approx(2.0**2 * 0.1, abs=0.02)
    assert spun.linear_acceleration.x == pytest.approx(0.0, abs=0.02)


def test_while_it_is_paused_nothing_new_is_seen_and_a_reset_starts_over(eyes: Eyes) -> None:
    odom = eyes.bus.subscribe("odom", Odometry, depth=1000)
    eyes.sim.step(1)
    eyes.forget()
    for _ in range(20):  # at 20 Hz: a second in which ten scans would come
        assert odom.recv().message
    assert not any(eyes.forget().values())
    eyes.sim.reset()
    stamps = [scan.header.stamp.seconds() for scan in eyes.after(3 * STEPS)["scan"]]
    assert stamps == pytest.approx([1 / 240, 0.1, 0.2, 0.3], abs=1e-6)


def test_the_states_of_all_models_and_links_are_those_of_the_world(
    lock_step: Callable[..., LockStep],
) -> None:
    sim = lock_step()
    entities.spawn(sim.bus, "wall", WALL, Pose(Point(2.0, 0.5, 2.0)))
    models, links = (
        sim.bus.subscribe("model_states", ModelStates),
        sim.bus.subscribe("link_states", LinkStates),
    )

    def moving(subscription: Subscription[Any]) -> dict[str, Any] | None:
        """Pose and twist by name, of the first message in which the robot moves and the wall is
        there.
        """
        sim.drive(x=0.3)
        sim.step(12)
        received = subscription.try_recv()
        states = received.message if received else None
        if not states or "wall" not in states.name[-1] or states.twist[0].linear.x < 0.2:
            return None
        return {
            name: (pose, twist)
            for name, pose, twist in zip(states.name, states.pose, states.twist, strict=True)
        }

    of_models = wait_for(partial(moving, models)) or {}
    of_links = wait_for(partial(moving, links)) or {}
    assert list(of_models) == ["hb_bot", "wall"] and of_links.keys() >= {
        "hb_bot::base_link",
        "wall::wall",
    }
    assert (
        of_models["wall"][0].position == of_links["wall::wall"][0].position == Point(2.0, 0.5, 2.0)
    )
    for twist in (of_models["hb_bot"][1], of_links["hb_bot::base_link"][1]):
        assert twist.linear.x == pytest.approx(0.3, abs=1e-3)
