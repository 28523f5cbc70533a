"""Messages have the names, fields and defaults of ROS, and refuse what they do not have."""

import math
import subprocess
import sys

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen import messages as m
from holozen.messages.message import not_finite
from holozen.robot.rotation import matrix_of, quaternion_of

ALL = [kind for kind in m.Message.__subclasses__() if kind.__module__.startswith(m.__name__)]


def test_a_message_of_nothing_is_finite_and_zero_but_for_the_unit_rotation() -> None:
    def numbers(value: object) -> list[object]:
        if isinstance(value, dict):
            # older sims lack the latter
            inner = {k: v for k, v in value.items() if k not in ("w", "strafes")}
            return [number for v in inner.values() for number in numbers(v)]
        return (
            [number for v in value for number in numbers(v)] if isinstance(value, list) else [value]
        )

    for kind in ALL:
        if kind.__name__ == "StepSimulationRequest":  # ROS's default is one step
            continue
        empty = kind()
        assert set(map(str, numbers(msgspec.to_builtins(empty)))) <= {"0", "0.0", "", "False"}, kind
        assert msgspec.json.decode(b"{}", type=kind) == empty, kind
        assert not_finite(empty) == "", kind


def test_all_are_there_for_a_script_that_imports_everything() -> None:
    script = (
        "from holozen.messages import *; print(Twist.__name__, TriggerReply.__name__, "
        "'Struct' in globals())"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60
    )
    assert done.stdout == "Twist TriggerReply False\n", done.stderr


def test_the_default_rotation_is_none() -> None:
    assert m.Quaternion() == m.Quaternion(0, 0, 0, 1)


def test_a_field_that_does_not_exist_is_refused_by_name() -> None:
    for kind in ALL:
        with pytest.raises(msgspec.ValidationError, match="`linaer`"):
            msgspec.json.decode(b'{"linaer": 1}', type=kind)


def test_messages_share_no_defaults() -> None:
    first, second = m.Odometry(), m.Odometry()
    first.twist.twist.linear.x = 1
    first.pose.covariance[0] = 1
    assert second == m.Odometry()


def test_a_covariance_has_36_numbers() -> None:
    for count, good in ((35, False), (36, True), (37, False)):
        text = msgspec.json.encode({"covariance": [0.0] * count})
        if good:
            msgspec.json.decode(text, type=m.PoseWithCovariance)
        else:
            with pytest.raises(msgspec.ValidationError, match="covariance"):
                msgspec.json.decode(text, type=m.PoseWithCovariance)


def test_seconds_have_the_32_bits_of_ros() -> None:
    for sec, good in [(2**31 - 1, True), (2**31, False), (-(2**31), True), (-(2**31) - 1, False)]:
        text = msgspec.json.encode({"sec": sec})
        if good:
            assert msgspec.json.decode(text, type=m.Time).sec == sec
        else:
            with pytest.raises(msgspec.ValidationError, match="sec"):
                msgspec.json.decode(text, type=m.Time)


def test_nanoseconds_are_less_than_a_second() -> None:
    for nanosec in [-1, 1_000_000_000]:
        with pytest.raises(msgspec.ValidationError, match="nanosec"):
            msgspec.json.decode(msgspec.json.encode({"nanosec": nanosec}), type=m.Time)


def test_a_time_is_the_one_nearest_to_the_seconds() -> None:
    for seconds, sec, nanosec in [
        (0.0, 0, 0),
        (1.5, 1, 500_000_000),
        (-0.25, -1, 750_000_000),
        (1 / 3, 0, 333_333_333),
        (0.999_999_999_9, 1, 0),
    ]:
        assert m.Time.of(seconds) == m.Time(sec, nanosec)


@given(st.floats(-1e6, 1e6))
def test_a_time_gives_its_seconds_back_to_the_nanosecond(seconds: float) -> None:
    time = m.Time.of(seconds)
    assert 0 <= time.nanosec < 1_000_000_000
    assert time.seconds() == pytest.approx(seconds, abs=1e-9)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_yaw_is_the_heading_also_of_a_body_that_leans(
    roll: float, pitch: float, yaw: float
) -> None:
    assert m.Quaternion(*quaternion_of(matrix_of((roll, pitch, yaw)))).yaw() == pytest.approx(
        yaw, abs=1e-9
    )


def test_yaw_of_half_a_turn_is_pi() -> None:
    assert m.Quaternion(0, 0, 1, 0).yaw() == pytest.approx(math.pi)


def test_a_planar_twist_is_forward_left_and_counter_clockwise() -> None:
    assert m.Twist.planar(1, 2, 3) == m.Twist(m.Vector3(1, 2, 0), m.Vector3(0, 0, 3))


def test_a_twist_is_a_stop_only_if_all_six_numbers_are_zero() -> None:
    for axis in ["x", "y", "z"]:
        for part in ["linear", "angular"]:
            twist = m.Twist()
            assert twist.is_slow()
            setattr(getattr(twist, part), axis, -1e-300)
            assert not twist.is_slow()
            assert twist.is_slow(0.01)
            for fast in (0.02, -0.02, math.nan):
                setattr(getattr(twist, part), axis, fast)
                assert not twist.is_slow(0.01)


def test_the_first_number_that_is_not_finite_is_named_by_its_path() -> None:
    for bad in [math.nan, math.inf, -math.inf]:
        still = m.TransformStamped()
        moved = m.TransformStamped(transform=m.Transform(rotation=m.Quaternion(w=bad)))
        spread = m.PoseWithCovariance(covariance=[0.0] * 7 + [bad] + [0.0] * 28)
        assert not_finite(m.Twist(linear=m.Vector3(y=bad), angular=m.Vector3(x=bad))) == "linear.y"
        assert not_finite(spread) == "covariance[7]"
        assert not_finite(m.TFMessage([still, moved])) == "transforms[1].transform.rotation.w"
