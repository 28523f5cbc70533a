"""Our own messages as CDR have the exact types of ROS, and what does not fit them is reported by
field.
"""

import math
from typing import Any

import msgspec
import pytest

from holozen import messages as m
from holozen.messages import cdr, struct_cdr
from holozen.messages import simulation_interfaces as s
from holozen.messages.codec import WIRES, CodecError, decode, encode, encoding
from holozen.messages.message import not_finite
from tests.core.messages.conftest import Rosbags

TF = m.TFMessage(
    [
        m.TransformStamped(m.Header(m.Time(1, 2), "odom"), "base"),
        m.TransformStamped(child_frame_id="wheel"),
    ]
)
ODOM = m.Odometry(m.Header(m.Time(-3, 999_999_999), "odom"), "base_link")
ODOM.pose.covariance[35] = 0.5
MESSAGES: list[m.Message] = [
    m.Twist.planar(0.3, -0.2, 1.5),
    m.TwistStamped(m.Header(frame_id="ä")),
    ODOM,
    TF,
    m.Clock(m.Time(7, 8)),
    m.JointState(name=["a", "bcd"], position=[1.0, 2.0], effort=[0.5]),
    m.TriggerRequest(),
    m.TriggerReply(True, "done"),
    m.NextGoalReply(1.0, 2.0, 3.0, 1),
    s.GetEntitiesReply(entities=["Fred"]),
    m.GetPoseReply(ODOM, 0.25),
]


def test_another_library_reads_and_writes_our_messages(rosbags: Rosbags) -> None:
    for message in MESSAGES:
        interface, value = struct_cdr.interface(type(message)), msgspec.to_builtins(message)
        payload = encode(message, "cdr")
        assert payload == rosbags.write(interface, value) == cdr.write(interface, value)
        assert rosbags.read(interface, payload) == value
        for little_endian in (True, False):
            theirs = rosbags.write(interface, value, little_endian)
            assert decode(theirs, "application/cdr", (type(message),)) == message


def test_counts_by_reason_are_pairs(rosbags: Rosbags) -> None:
    status = m.CommandStatus(
        obeyed="teleop", refused={"late": 3, "malformed": 2**63}, sources=[m.CommandSource("a")]
    )
    payload = encode(status, "cdr")
    reported = rosbags.read(struct_cdr.interface(m.CommandStatus), payload)
    assert reported["refused"] == [
        {"reason": "late", "count": 3},
        {"reason": "malformed", "count": 2**63},
    ]
    assert decode(payload, "application/cdr", (m.CommandStatus,)) == status


def test_the_encoding_names_the_type() -> None:
    assert encoding("cdr", m.Twist) == "application/cdr;geometry_msgs/msg/Twist"
    assert encoding("cdr", m.TriggerRequest) == "application/cdr;std_srvs/srv/Trigger_Request"
    assert encoding("cdr", m.TriggerReply) == "application/cdr;std_srvs/srv/Trigger_Response"
    assert encoding("json", m.Twist) == "application/json"


def test_the_type_that_the_encoding_names_is_the_one_that_is_read() -> None:
    kinds = (m.Twist, m.TwistStamped)
    for message in (m.Twist.planar(1), m.TwistStamped(twist=m.Twist.planar(2))):
        payload = encode(message, "cdr")
        assert decode(payload, encoding("cdr", type(message)), kinds) == message
        assert decode(payload, "application/cdr", kinds) == message
        assert (
            decode(payload, f"application/cdr;{message.ROS.replace('/', '::')}", kinds) == message
        )


def test_another_type_with_the_same_layout_is_refused_by_its_name() -> None:
    accel = encode(m.Accel(m.Vector3(1.0)), "cdr")
    with pytest.raises(
        CodecError, match=r"^not a Twist: its encoding names geometry_msgs/msg/Accel$"
    ):
        decode(accel, "application/cdr;geometry_msgs/msg/Accel", (m.Twist, m.TwistStamped))


def test_a_schema_that_names_no_type_is_ignored() -> None:
    for schema in ["", ";", ";Twist", ";a b c", ";" + "x" * 5000]:
        assert decode(
            encode(m.Twist.planar(1), "cdr"), f"application/cdr{schema}", (m.Twist,)
        ) == m.Twist.planar(1)


def test_cdr_without_its_encoding_is_recognised() -> None:
    """Bridges to ROS 2 give their samples no Encoding."""
    for expected in ["", "zenoh/bytes"]:
        assert decode(encode(m.Twist.planar(1), "cdr"), expected, (m.Twist,)) == m.Twist.planar(1)


def test_numbers_within_a_field_are_held_to_its_range() -> None:
    payload = cdr.write(
        struct_cdr.interface(m.Clock), {"clock": {"sec": 1, "nanosec": 1_000_000_000}}
    )
    with pytest.raises(
        CodecError, match=r"^not a Clock: nanosec of 1000000000; use a number from 0 to 999999999$"
    ):
        decode(payload, "application/cdr", (m.Clock,))


def test_a_nan_in_cdr_reaches_the_reader_which_must_check_for_it() -> None:
    payload = cdr.write(struct_cdr.interface(m.Twist), {"linear": {"x": math.nan}})
    assert not_finite(decode(payload, "application/cdr", (m.Twist,))) == "linear.x"


def test_a_number_in_a_list_that_is_not_finite_is_not_written() -> None:
    for bad in [math.nan, math.inf, -math.inf]:
        with pytest.raises(CodecError, match=r"^JointState\.effort\[1\] is not a finite number$"):
            encode(m.JointState(effort=[0.0, bad]), "cdr")


def test_large_numbers_are_finite_even_where_their_sum_is_not() -> None:
    state = m.JointState(position=[1.7e308, 1.7e308])
    assert decode(encode(state, "cdr"), "application/cdr", (m.JointState,)) == state


def test_a_value_that_does_not_fit_is_reported_with_its_field() -> None:
    for message, reason in [
        (
            m.NextGoalRequest(2**63),
            "NextGoalRequest: request_goal: 9223372036854775808 is not a valid int64",
        ),
        (m.Twist(m.Vector3(x="fast")), "Twist: linear.x: 'fast' is not a valid float64"),  # type: ignore[arg-type]
        (
            m.PoseWithCovariance(covariance=[0.0] * 35),
            "PoseWithCovariance: covariance: 35 values for float64[36]",
        ),
        (
            m.Odometry(
                m.Header(),
                "",
                m.PoseWithCovariance(covariance=[0.0] * 35),
                m.TwistWithCovariance(covariance=[0.0] * 37),
            ),
            "Odometry: pose.covariance: 35 values for float64[36]",
        ),
        (m.JointState(name=[3]), "JointState: name[0]: 3 is not a valid string"),  # type: ignore[list-item]
        (s.Result(result=256), "Result: result: 256 is not a valid uint8"),
        (
            m.Twist(linear=None),  # type: ignore[arg-type]
            "Twist: linear: None is not a mapping of fields; write {x: ..., y: ..., z: ...}",
        ),
    ]:
        with pytest.raises(CodecError) as error:
            encode(message, "cdr")
        assert str(error.value) == reason


def test_a_long_reason_is_cut() -> None:
    with pytest.raises(CodecError) as error:
        decode(b"{}", "application/cdr;" + "a" * 5000 + "/msg/B", (m.Twist,))
    assert len(str(error.value)) < 300


def test_every_wire_has_an_encoding_for_every_message() -> None:
    kinds: list[Any] = [type(message) for message in MESSAGES]
    for wire in WIRES:
        for message, kind in zip(MESSAGES, kinds, strict=True):
            assert decode(encode(message, wire), encoding(wire, kind), (kind,)) == message
