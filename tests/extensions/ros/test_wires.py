"""Generated messages are the same bytes as our own, as an independent library's CDR, and survive
every wire.
"""

import copy
import operator
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holozen import messages as m
from holozen.messages.codec import WIRES, CodecError, decode, encode, encoding, written
from holozen.messages.definitions import Field, Interface, completed, prototype
from holozen.messages.message import listed
from holozen.messages.registry import Registry
from holozen.ros import generated
from tests.core.messages.conftest import Rosbags
from tests.core.messages.strategies import elements, values

REGISTRY = Registry()
NAMES = REGISTRY.names()
PACKAGES = (
    "geometry_msgs",
    "nav_msgs",
    "std_msgs",
    "std_srvs",
    "sensor_msgs",
    "builtin_interfaces",
    "rosgraph_msgs",
    "tf2_msgs",
    "visualization_msgs",
    "rcl_interfaces",
)
MESSAGES = [
    name + half
    for name in NAMES
    if "/action/" not in name
    for half in (("_Request", "_Response") if "/srv/" in name else ("",))
]
TF = m.TFMessage([m.TransformStamped(m.Header(m.Time(1, 2), "odom"), "base"), m.TransformStamped()])
ODOM = m.Odometry(
    m.Header(m.Time(-3, 999_999_999), "odom"),
    "base_link",
    twist=m.TwistWithCovariance(m.Twist.planar(1.0)),
)
OURS: list[m.Message] = [
    m.Twist.planar(0.3, -0.2, 1.5),
    m.TwistStamped(m.Header(frame_id="ä")),
    ODOM,
    TF,
    m.Clock(m.Time(7, 8)),
    m.JointState(name=["a", "bcd"], position=[1.0, 2.0], effort=[0.5]),
    m.TriggerRequest(),
    m.Pose(),
    m.TriggerReply(True, "done"),
    m.NextGoalReply(1.0, 2.0, 3.0, 1),
    m.GetPoseReply(ODOM, 0.25),
]


@pytest.fixture(scope="module")
def rosbags() -> Rosbags:
    return Rosbags()


def test_the_tables_hold_the_packages_of_the_lessons() -> None:
    assert set(PACKAGES) <= {name.partition("/")[0] for name in NAMES}


def plain(message: m.Message) -> Any:
    return msgspec.to_builtins(message, enc_hook=listed)


def survived(message: m.Message) -> None:
    """Each wire carries it, or CDR in its stead; a NaN equals nothing, so it is what they show that
    is compared.
    """
    kind = type(message)
    for wire in WIRES:
        payload, used = written(message, wire)
        assert used in (wire, "cdr")
        assert repr(decode(payload, encoding(used, kind), (kind,))) == repr(message)


def twin(message: m.Message) -> Any:
    """The generated class of a message of ours."""
    end = {"Request": "_Request", "Reply": "_Response"}
    name = type(message).__name__
    half = next(
        (half for word, half in end.items() if "/srv/" in message.ROS and name.endswith(word)), ""
    )
    return generated.find(message.ROS + half)


def test_a_generated_message_and_ours_are_the_same_bytes() -> None:
    for message in OURS:
        kind = twin(message)
        for wire in WIRES:
            payload = encode(message, wire)
            read = decode(payload, encoding(wire, kind), (kind,))
            assert encode(read, wire) == payload
            assert encoding(wire, kind) == encoding(wire, type(message))
            assert decode(encode(read, wire), encoding(wire, kind), (type(message),)) == message


def test_every_type_is_made_and_any_value_of_it_is_the_same_bytes_as_another_librarys(
    rosbags: Rosbags,
) -> None:
    def agree(interface: Interface, value: dict[str, Any]) -> None:
        message = filled(interface, value)
        assert repr(plain(message)) == repr(completed(interface, value))
        assert encode(message, "cdr") == rosbags.write(interface, value), interface.name
        survived(message)

    for name in MESSAGES:
        interface, kind = REGISTRY.find(name), generated.find(name)
        message = kind()
        assert plain(message) == prototype(interface), name
        assert (
            kind(**{field: getattr(message, field) for field in message.__struct_fields__})
            == message
        ), name
        for wire in WIRES:
            payload = encode(message, wire)
            assert decode(payload, encoding(wire, kind), (kind,)) == message, f"{name} as {wire}"
            assert wire != "cdr" or payload == rosbags.write(interface, prototype(interface)), name
        settings(max_examples=2)(given(st.just(interface), values(interface))(agree))()


def filled(interface: Interface, value: dict[str, Any]) -> Any:
    """A message made as a script does, of messages made so."""

    def of(field: Field) -> Any:
        given, nested = value[field.name], field.nested
        if not nested:
            return given
        return [filled(nested, each) for each in given] if field.array else filled(nested, given)

    return generated.make(interface)(**{field.name: of(field) for field in interface.fields})


FIELDS = [
    Field("some", kind, array, bound)
    for kind in ("bool", "byte", "int8", "uint64", "float32", "float64", "string")
    for array, bound in (("", 0), ("fixed", 2), ("sequence", 0), ("bounded", 3))
]


def test_what_a_field_takes_is_written_and_read() -> None:
    for field in FIELDS:
        most, one = field.bound or 3, elements(field)
        every = (
            st.lists(one, min_size=2 if field.array == "fixed" else 0, max_size=most)
            if field.array
            else one
        )
        kind = generated.make(Interface("t/msg/Some", "msg", (field,)))
        settings(max_examples=15)(given(st.builds(kind, some=every))(survived))()


def test_what_was_put_into_a_list_is_written_as_its_field_type() -> None:
    rows: list[tuple[str, Any, Any]] = [
        ("byte", [b"\x07"], [7]),
        ("string", [type("Text", (str,), {})("x")], ["x"]),
    ]
    for kind, put, held in rows:
        for wire in WIRES:
            made: Any = generated.make(
                Interface("t/msg/L", "msg", (Field("some", kind, "sequence"),))
            )
            message = made()
            message.some.extend(put)
            assert decode(encode(message, wire), encoding(wire, made), (made,)).some == held
            assert all(
                type(one) is type(plain) for one, plain in zip(message.some, held, strict=True)
            )


def test_numbers_of_numpy_may_be_put_into_lists() -> None:
    for wire in WIRES:
        import numpy as np

        made: Any = generated.make(
            Interface(
                "t/msg/N",
                "msg",
                (
                    Field("f", "float64", "fixed", 3),
                    Field("i", "int32", "fixed", 2),
                    Field("b", "bool", "sequence"),
                    Field("a", "float64", "sequence"),
                ),
            )
        )
        message = made()
        message.a.extend([np.float64(0.5), np.float32(1.5), np.int64(2)])
        message.f[:] = message.a
        message.i[:] = np.array([1, 2])
        message.b.append(np.True_)
        read = decode(encode(message, wire), encoding(wire, made), (made,))
        assert (read.f, read.i, read.b, read.a.tolist()) == (
            [0.5, 1.5, 2.0],
            [1, 2],
            [True],
            [0.5, 1.5, 2.0],
        )


JOINTS, VALUE, ODOMETRY = (
    "sensor_msgs/msg/JointState",
    "rcl_interfaces/msg/ParameterValue",
    "nav_msgs/msg/Odometry",
)
MARKER = generated.find("visualization_msgs/msg/Marker")
COVARIANCE = "' field of geometry_msgs.msg.PoseWithCovariance"
BYTE = "' field of rcl_interfaces.msg.ParameterValue must be of type 'int'"


def test_what_no_list_holds_is_refused_when_it_is_written() -> None:
    for name, place, put, reason in [
        (
            JOINTS,
            "name",
            3,
            "The 'name[0]' field of sensor_msgs.msg.JointState must be of type 'str', not 'int' "
            "(3)",
        ),
        (
            ODOMETRY,
            "pose.covariance",
            0.0,
            f"The 'covariance{COVARIANCE} must be a sequence of exactly 36 values ",
        ),
        (
            VALUE,
            "byte_array_value",
            256,
            f"The 'byte_array_value[0]{BYTE} in [0, 255], not 'int' (256)",
        ),
        (
            VALUE,
            "byte_array_value",
            1.5,
            f"The 'byte_array_value[0]{BYTE} in [0, 255], not 'float' (1.5)",
        ),
        (
            "nav_msgs/msg/Path",
            "poses",
            m.Pose(),
            "The 'poses[0]' field of nav_msgs.msg.Path must be a sub message of",
        ),
        (
            "visualization_msgs/msg/MarkerArray",
            "markers",
            copy.deepcopy(MARKER()),
            "The 'points[0]' field of visualization_msgs.msg.Marker must be a sub message of type "
            "'Point',",
        ),
    ]:
        for wire in WIRES:
            message = generated.find(name)()
            operator.attrgetter(place)(message).append(put)
            if isinstance(put, MARKER):
                put.points[:] = [1]
            with pytest.raises(CodecError) as error:
                encode(message, wire)
            assert str(error.value).startswith(reason)
            assert "\n" not in str(error.value)


def test_what_is_put_into_a_fixed_list_is_refused_when_it_is_written() -> None:
    for put in ("1", None):
        for wire in WIRES:
            message = generated.find(ODOMETRY)()
            message.pose.covariance[35] = put
            with pytest.raises(
                CodecError,
                match=rf"^The 'covariance\[35\]{COVARIANCE} must be of type 'float', not",
            ):
                encode(message, wire)


def test_two_types_with_one_name_in_one_message() -> None:
    for wire in WIRES:
        one = Interface("a/msg/Part", "msg", (Field("x", "int8"),))
        two = Interface("b/msg/Part", "msg", (Field("name", "string"),))
        fields = (Field("a", one.name, nested=one), Field("b", two.name, "sequence", nested=two))
        kind: Any = generated.make(Interface("c/msg/Part", "msg", fields))
        message = kind(a=generated.make(one)(x=3), b=[generated.make(two)(name="n")])
        read = decode(encode(message, wire), encoding(wire, kind), (kind,))
        assert read == message
        assert [type(part).__module__ for part in (read, read.a, read.b[0])] == [
            "c.msg",
            "a.msg",
            "b.msg",
        ]


def test_bad_bytes_are_reported_as_for_ours() -> None:
    for wire, payload, reason in [
        ("json", b'{"linaer": {}}', "not a Twist: Object contains unknown field `linaer`"),
        (
            "json",
            b'{"linear": {"x": "a"}}',
            "not a Twist: Expected `float`, got `str` - at `$.linear.x`",
        ),
        ("cdr", b"\0\1\0\0\0", "not a Twist: cut off after 5 bytes"),
    ]:
        with pytest.raises(CodecError) as error:
            decode(payload, WIRES[wire], (generated.find("geometry_msgs/msg/Twist"),))
        assert str(error.value) == reason


def test_a_range_holds_in_every_wire() -> None:
    kind = generated.find("sensor_msgs/msg/Image")
    for payload, reason in (
        (b'{"height": -1}', "`$.height`"),
        (b'{"data": [256]}', "`$.data[0]`"),
        (b'{"height": 1.5}', "`$.height`"),
    ):
        with pytest.raises(CodecError, match="not an Image") as error:
            decode(payload, WIRES["json"], (kind,))
        assert reason in str(error.value)


def test_a_wstring_has_no_cdr() -> None:
    kind: Any = generated.make(Interface("t/msg/Wide", "msg", (Field("text", "wstring"),)))
    assert decode(encode(kind(text="x")), "", (kind,)).text == "x"
    with pytest.raises(CodecError, match="do not agree on how to write a wstring"):
        encode(kind(text="x"), "cdr")
