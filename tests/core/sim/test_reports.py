"""What a robot publishes: rates kept exactly, Gazebo's covariances, frames that numpy agrees
with.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.messages import Header, Quaternion, Time, Twist
from holozen.odometry import odometry, transform
from holozen.robot.files.loading import load
from holozen.robot.model import Drive, Joint, Limits, Link, Pose, RobotModel
from holozen.robot.rotation import Array, matrix_of, quaternion_of
from services.sim.io.topics import JointFrames, covariance
from services.sim.schedule import Schedule

REPO = Path(__file__).parents[3]
HB_BOT = load(REPO / "urdf" / "hb_bot.urdf.xacro")
angles = st.floats(-3, 3)


def test_ten_minutes_at_240_hz_have_every_message_and_not_one_more() -> None:
    for rate in [1, 7, 30, 50, 200, 240]:
        schedule = Schedule(rate)
        first = rate < 240  # the one at the first step, before a period has passed
        assert (
            sum(schedule.advance(step / 240) for step in range(1, 600 * 240 + 1))
            == 600 * rate + first
        )


@pytest.mark.parametrize("rate", [20, 30, 50, 60])
def test_messages_are_never_more_than_a_step_from_their_time(rate: float) -> None:
    schedule = Schedule(rate)
    due = [step / 240 for step in range(240 * 60) if schedule.advance(step / 240)]
    assert all(0 <= time - number / rate < 1 / 240 for number, time in enumerate(due))


def test_a_rate_above_the_steps_is_due_at_each_step() -> None:
    schedule = Schedule(1000)
    assert all(schedule.advance(step / 240) for step in range(2400))


@pytest.mark.parametrize("rate", [1.0, 1000.0])
def test_another_rate_holds_at_once(rate: float) -> None:
    schedule = Schedule(50)
    assert schedule.advance(100.0)
    schedule.set_rate(rate)
    assert schedule.advance(100.001)
    assert not schedule.advance(100.0011)
    assert schedule.advance(100.002 + 1 / rate)


def test_it_is_due_at_the_first_look_and_once_after_a_gap() -> None:
    schedule = Schedule(10)
    assert schedule.advance(1e5)
    assert not schedule.advance(1e5 + 0.05)
    assert schedule.advance(1e5 + 3)
    assert not schedule.advance(1e5 + 3.05)


def test_the_covariance_is_the_one_of_gazebos_planar_move() -> None:
    expected = np.diag([1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3])
    assert np.array_equal(np.reshape(covariance(Drive()), (6, 6)), expected)
    assert covariance(Drive(covariance=(1, 2, 3)))[::7] == [1, 2, 1e12, 1e12, 1e12, 3]


def test_odometry_is_the_world_pose_and_the_body_velocity_with_both_covariances() -> None:
    header, variances = Header(Time(1, 2), "odom"), [float(i) for i in range(36)]
    odom = odometry(header, "base", (1, 2, 3), (0, 0, 1, 0), (0.1, 0.2, 0.3), variances)
    assert (odom.header, odom.child_frame_id) == (header, "base")
    position = odom.pose.pose.position
    assert (position.x, position.y, position.z) == (1, 2, 3)
    assert odom.pose.pose.orientation == Quaternion(0, 0, 1, 0)
    assert odom.twist.twist == Twist.planar(0.1, 0.2, 0.3)
    assert odom.pose.covariance == odom.twist.covariance == variances


def test_a_transform_gives_the_child_in_the_header_frame() -> None:
    reported = transform(Header(Time(1), "odom"), "base", (1, 2, 3), (0, 0, 1, 0))
    assert (reported.header.frame_id, reported.child_frame_id) == ("odom", "base")
    assert (reported.transform.translation.x, reported.transform.translation.z) == (1, 3)
    assert reported.transform.rotation == Quaternion(0, 0, 1, 0)


def matrix(q: Quaternion) -> Array:
    cross = np.array([[0, -q.z, q.y], [q.z, 0, -q.x], [-q.y, q.x, 0]])
    turned: Array = np.eye(3) + 2 * q.w * cross + 2 * cross @ cross
    return turned


@given(st.tuples(angles, angles, angles), st.tuples(*[st.floats(-1, 1)] * 3), st.floats(-50, 50))
def test_a_joint_turns_its_child_about_its_axis_in_the_parents_frame(
    rpy: tuple[float, float, float], axis: tuple[float, float, float], angle: float
) -> None:
    length = math.hypot(*axis)
    x, y, z = (a / length for a in axis) if length > 1e-3 else (0.0, 0.6, 0.8)
    joint = Joint("j", "continuous", "a", "b", Pose((1, 2, 3), rpy), (x, y, z), Limits())
    model = RobotModel("r", "a", {n: Link(n, None, (), ()) for n in "ab"}, {"j": joint}, None, ())
    (reported,) = JointFrames(model, "").transforms(Time(), {"j": angle})
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    about = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross  # Rodrigues
    assert matrix(reported.transform.rotation) == pytest.approx(matrix_of(rpy) @ about, abs=1e-9)
    assert (reported.transform.translation.x, reported.transform.translation.y) == (1, 2)


def test_a_prismatic_joint_slides_its_child_along_its_axis_in_the_parents_frame() -> None:
    joint = Joint(
        "j", "prismatic", "a", "b", Pose((1, 2, 3), (0, 0, math.pi / 2)), (1, 0, 0), Limits()
    )
    model = RobotModel("r", "a", {n: Link(n, None, (), ()) for n in "ab"}, {"j": joint}, None, ())
    (found,) = JointFrames(model, "").transforms(Time(), {"j": 0.5})
    at = found.transform.translation
    assert (at.x, at.y, at.z) == pytest.approx((1, 2.5, 3))
    assert found.transform.rotation.yaw() == pytest.approx(math.pi / 2)


def test_every_joint_of_the_robot_has_a_transform_with_its_prefix() -> None:
    reported = JointFrames(HB_BOT, "Fred/").transforms(Time(7), {})
    assert {(t.header.frame_id, t.child_frame_id) for t in reported} == {
        ("Fred/footprint_link", "Fred/base_link"),
        *(("Fred/base_link", f"Fred/{name}_wheel_link") for name in ("front", "left", "right")),
    }
    assert all(t.header.stamp == Time(7) for t in reported)
    at = {t.child_frame_id: t.transform for t in reported}["Fred/left_wheel_link"]
    *_, z, w = quaternion_of(matrix_of((0, 0, math.atan2(0.58, -0.36))))
    assert (at.rotation.z, at.rotation.w) == pytest.approx((z, w))
    assert (at.translation.x, at.translation.y, at.translation.z) == (-0.58, -0.36, 0.18)
