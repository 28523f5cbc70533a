"""What a sim publishes: fields, frames, rates, and the last value on request."""

import json
import math
from itertools import pairwise
from typing import Any

import pytest
import zenoh

from holozen.messages import Clock, JointState, Odometry, TFMessage, Twist
from holozen.testing import Wire, wait_for

from .robots import Record, Robot, moves, place, record, time_of

KEYS = ("odom", "joint_states", "tf", "clock", "cmd_vel_status")

# hb_bot's wheels as the lesson gives them: where they are (m), and where their axles point: along
# the radius.
WHEELS = {
    "front_wheel_joint": (0.0, 0.68),
    "left_wheel_joint": (-0.58, -0.36),
    "right_wheel_joint": (0.58, -0.36),
}
RADIUS = 0.14  # m


def wheel_rates(x: float, y: float, turn: float) -> dict[str, float]:
    """rad/s of each wheel, right-handed about its axle; the ground speed across the axle is rolled
    off.
    """
    rates = {}
    for name, (wx, wy) in WHEELS.items():
        length = math.hypot(wx, wy)
        # the axle, turned by -90 degrees: where a wheel of positive rate rolls
        across = (wy / length, -wx / length)
        rates[name] = ((x - turn * wy) * across[0] + (y + turn * wx) * across[1]) / RADIUS
    return rates


@pytest.fixture(scope="module")
def joints(only_robot: Robot) -> Record:
    return record(only_robot.bus, "joint_states", JointState)


@pytest.fixture(scope="module")
def transforms(only_robot: Robot) -> Record:
    return record(only_robot.bus, "tf", TFMessage)


def last_value(session: zenoh.Session, key: str) -> Any:
    """What a plain `get` on a key gives: one JSON object."""
    replies = [reply.ok for reply in session.get(key, timeout=5) if reply.ok]
    assert [str(reply.key_expr) for reply in replies] == [key]
    assert str(replies[0].encoding) == "application/json"
    return json.loads(bytes(replies[0].payload))


def test_odom_names_the_frames_of_the_robots_tag_and_gazebos_covariances(robot: Robot) -> None:
    odom = robot.newest()
    assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "footprint_link")
    diagonal = [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3]
    expected = [diagonal[i] if i == j else 0.0 for i in range(6) for j in range(6)]
    assert odom.pose.covariance == expected
    assert odom.twist.covariance == expected


def test_the_robot_settles_on_its_wheels(robot: Robot) -> None:
    """The lesson hangs them 4 cm above the ground."""
    robot.odom.next(lambda odom: time_of(odom) > 1)
    pose = robot.newest().pose.pose
    assert pose.position.z == pytest.approx(-0.04, abs=2e-3)
    assert (pose.orientation.x, pose.orientation.y) == pytest.approx((0, 0), abs=1e-3)


def test_odom_comes_at_the_rate_of_its_tag_by_its_own_stamps(robot: Robot) -> None:
    robot.pass_time(1.0)
    stamps = [time_of(odom) for odom in robot.odom.messages()[-50:]]
    gaps = [later - earlier for earlier, later in pairwise(stamps)]
    assert min(gaps) > 0
    assert all(0.02 - 1 / 240 - 1e-6 <= gap <= 0.02 + 1 / 240 + 1e-6 for gap in gaps), (
        "none was left out"
    )
    assert stamps[-1] - stamps[0] == pytest.approx(49 * 0.02, abs=1 / 120)


def test_odom_has_the_pose_in_the_world_and_the_twist_in_the_body(robot: Robot) -> None:
    robot.drive(0, 0, 1, until=lambda odom: 1.2 < place(odom)[2] < 1.9)
    start = robot.stop()
    odom = next(odom for odom in robot.drive(0.5) if moves(odom, 0.5, 0, 0))
    end = robot.stop()
    yaw = place(start)[2]
    forward = (place(end)[0] - place(start)[0], place(end)[1] - place(start)[1])
    assert math.atan2(forward[1], forward[0]) == pytest.approx(yaw, abs=1e-2)
    assert (
        odom.twist.twist.linear.z == odom.twist.twist.angular.x == odom.twist.twist.angular.y == 0
    )


@pytest.mark.parametrize("velocity", [(0.5, 0, 0), (0, 0.5, 0), (0, 0, 1), (0.3, -0.2, 0.7)])
def test_the_wheels_turn_as_wheels_that_roll(
    patient: Robot, joints: Record, velocity: tuple[float, float, float]
) -> None:
    patient.drive(*velocity)
    states = joints.from_now()
    patient.drive(*velocity, until=lambda _: len(states.messages()) >= 3)
    first, _, last, *_ = states.messages()
    expected = wheel_rates(*velocity)
    seconds = last.header.stamp.seconds() - first.header.stamp.seconds()
    assert dict(zip(last.name, last.velocity, strict=True)) == pytest.approx(expected, abs=1e-3)
    for i, name in enumerate(last.name):
        assert last.position[i] - first.position[i] == pytest.approx(
            expected[name] * seconds, abs=1e-4
        )
    patient.stop()


def test_the_wheels_of_a_standing_robot_stand(robot: Robot, joints: Record) -> None:
    state = joints.next()
    assert sorted(state.name) == sorted(WHEELS)
    assert state.velocity == pytest.approx([0, 0, 0], abs=1e-4)


def test_tf_places_every_link_from_odom_on(robot: Robot, transforms: Record) -> None:
    parents: dict[str, str] = {}

    def complete() -> bool:
        for message in transforms.messages():
            parents.update({t.child_frame_id: t.header.frame_id for t in message.transforms})
        return len(parents) >= 5

    wait_for(complete)
    wheels = {f"{name.removesuffix('_joint')}_link": "base_link" for name in WHEELS}
    assert parents == {"footprint_link": "odom", "base_link": "footprint_link", **wheels}


def test_tf_and_odom_agree(robot: Robot, transforms: Record) -> None:
    begin = time_of(robot.drive(0.5, 0.2, 0.7)[-1])
    robot.drive(0.5, 0.2, 0.7, until=lambda odom: time_of(odom) > begin + 0.5)
    odoms = {time_of(odom): odom.pose.pose for odom in robot.odom.messages()}
    pairs = [
        (t, odoms[t.header.stamp.seconds()])
        for message in transforms.messages()
        for t in message.transforms
        if t.child_frame_id == "footprint_link" and t.header.stamp.seconds() in odoms
    ]
    assert len(pairs) > 20
    for t, pose in pairs:
        translation, position = t.transform.translation, pose.position
        assert (translation.x, translation.y, translation.z) == (position.x, position.y, position.z)
        assert t.transform.rotation == pose.orientation


def test_clock_is_sim_time(robot: Robot) -> None:
    clock = record(robot.bus, "clock", Clock)
    clock.next()
    robot.pass_time(0.3)
    times = [message.clock.seconds() for message in clock.messages()]
    assert all(later > earlier for earlier, later in pairwise(times))
    before = time_of(robot.newest())
    reported = clock.next().clock.seconds()
    assert before - 0.05 <= reported <= time_of(robot.newest()) + 0.05


def test_a_plain_get_gives_the_last_value(robot: Robot, foreign: zenoh.Session) -> None:
    for key in KEYS:
        assert last_value(foreign, key)


def test_the_last_value_of_odom_is_the_newest(robot: Robot, foreign: zenoh.Session) -> None:
    before = robot.newest().header.stamp.seconds()
    stamp = last_value(foreign, "odom")["header"]["stamp"]
    assert stamp["sec"] + stamp["nanosec"] * 1e-9 >= before


def test_the_fields_are_those_of_ros(robot: Robot, foreign: zenoh.Session) -> None:
    odom = last_value(foreign, "odom")
    assert list(odom) == ["header", "child_frame_id", "pose", "twist"]
    assert list(odom["header"]) == ["stamp", "frame_id"]
    assert list(odom["pose"]) == ["pose", "covariance"]
    assert list(odom["pose"]["pose"]) == ["position", "orientation"]
    assert list(odom["twist"]["twist"]) == ["linear", "angular"]


CDR_TWIST = "application/cdr;geometry_msgs/msg/Twist"


def test_a_client_that_speaks_cdr_drives_and_reads(robot: Robot, town: Wire) -> None:
    bus = town.bus("client", wire="cdr")
    odom, commands = record(bus, "odom", Odometry), bus.publisher("cmd_vel", Twist)

    def driven() -> bool:
        commands.put(Twist.planar(0.3))
        encodings = {received.encoding for received in robot.commands.all()}
        return moves(odom.next(), 0.3, 0, 0) and CDR_TWIST in encodings

    wait_for(driven)


def test_a_sim_that_speaks_cdr_is_read_and_driven_in_json(wire: Wire) -> None:
    wire.start("sim", "--wire", "cdr").wait_for_line("listens on")
    robot = Robot(wire.bus())
    robot.drive(0.3)
    assert {received.encoding for received in robot.odom.all()} == {
        "application/cdr;nav_msgs/msg/Odometry"
    }
    assert wire.run("topic", "echo", "odom", "--once").stdout.startswith(
        "header:\n  stamp:\n    sec: "
    )
