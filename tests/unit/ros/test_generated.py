"""Generated classes take, hold and say what ROS's do."""

import array
import copy
import operator
import pickle
from typing import Any

import numpy as np
import pytest

from holozen.interfaces import Constant, Field, Interface, InterfaceError
from holozen.interfaces.parser import parse
from holozen.interfaces.registry import Registry
from holozen.ros import generated

TWIST, VECTOR = generated.find("geometry_msgs/msg/Twist"), generated.find("geometry_msgs/msg/Vector3")
JOINTS, TIME = generated.find("sensor_msgs/msg/JointState"), generated.find("builtin_interfaces/msg/Time")


def made(text: str, name: str = "t/msg/T") -> Any:
    """The class of a definition."""
    (section,) = parse(text, "here", Registry().find)
    return generated.make(Interface(name, "msg", *section))


def refused(message: Any, name: str, value: Any) -> str:
    with pytest.raises(AssertionError) as error:
        setattr(message, name, value)
    with pytest.raises(AssertionError) as same:
        type(message)(**{name: value})
    assert str(same.value) == str(error.value)
    assert "\n" not in str(error.value)
    return str(error.value)


def doubles(*values: float) -> "array.array[float]":
    return array.array("d", values)


def test_a_twist_is_made_changed_compared_and_shown_as_in_ros() -> None:
    twist = TWIST(linear=VECTOR(x=0.5))
    twist.angular.z = -1.0
    assert repr(twist) == str(twist) == (
        "geometry_msgs.msg.Twist(linear=geometry_msgs.msg.Vector3(x=0.5, y=0.0, z=0.0),"
        " angular=geometry_msgs.msg.Vector3(x=0.0, y=0.0, z=-1.0))"
    )  # fmt: skip
    assert twist == TWIST(linear=VECTOR(x=0.5), angular=VECTOR(z=-1.0))
    assert twist != TWIST()
    assert twist.__slots__ == ["_linear", "_angular"]
    assert twist._linear is twist.linear
    assert twist.get_fields_and_field_types() == {
        "linear": "geometry_msgs/Vector3",
        "angular": "geometry_msgs/Vector3",
    }
    assert (TWIST.__name__, TWIST.__module__) == ("Twist", "geometry_msgs.msg")
    with pytest.raises(TypeError, match="unhashable"):
        hash(twist)


def test_no_two_messages_share_a_part() -> None:
    first, second = TWIST(), TWIST()
    first.linear.x = 1.0
    assert second.linear.x == 0.0
    odom = generated.find("nav_msgs/msg/Odometry")()
    odom.pose.covariance[0] = 1.0
    assert odom.twist.covariance[0] == 0.0
    points = made("geometry_msgs/Point[2] p")().p
    points[0].x = 1.0
    assert points[1].x == 0.0


def test_copies_are_deep_and_pickles_are_read() -> None:
    state = JOINTS(name=["a"], position=[1.0])
    for other in (copy.deepcopy(state), pickle.loads(pickle.dumps(state))):
        assert other == state
        other.position.append(2.0)
        other.header.stamp.sec = 7
        assert (state.position, state.header.stamp.sec) == (doubles(1.0), 0)
    assert copy.copy(state).position is state.position


def test_defaults_and_constants_are_those_of_the_definition() -> None:
    assert generated.find("geometry_msgs/msg/Quaternion")().w == 1.0
    kind = made(
        'int32 TOP=7\nstring WORD="hi"\nint8 a -3\nstring b "x"\nfloat32[2] c [1, 2]\nbool[] d [true]\nbyte e 1'
    )
    message = kind()
    assert (kind.TOP, message.TOP, kind.WORD) == (7, 7, "hi")
    assert (message.a, message.b, message.c, message.d, message.e) == (-3, "x", [1.0, 2.0], [True], 1)
    message.c[0] = 9.0
    assert kind().c == [1.0, 2.0]
    with pytest.raises(AttributeError, match="has no field 'TOP'"):
        message.TOP = 8


def test_fields_are_given_by_their_names_only() -> None:
    with pytest.raises(TypeError, match=r"^geometry_msgs\.msg\.Twist takes its fields by name: Twist\(linear=..., ang"):
        TWIST(VECTOR())
    with pytest.raises(
        AssertionError, match=r"geometry_msgs\.msg\.Twist has no field 'linaer'; did you mean linear\?$"
    ):
        TWIST(linaer=VECTOR())
    with pytest.raises(AttributeError, match=r"^geometry_msgs\.msg\.Vector3 has no field 'q'; it has x, y, z$"):
        TWIST().linear.q = 1.0
    with pytest.raises(AttributeError, match="has no field 'x'; it has none"):
        generated.find("std_msgs/msg/Empty")().x = 1


@pytest.mark.parametrize(
    ("kind", "value", "reason"),
    [
        ("float64", 1, "of type 'float', not 'int' (1); write 1.0, or float(...)"),
        ("float64", np.float32(1), "of type 'float', not 'float32' (np.float32(1.0)); write float(...)"),
        ("float64", "1", "of type 'float', not 'str' ('1')"),
        ("float64", None, "of type 'float', not 'NoneType' (None)"),
        ("float32", 3.5e38, "of type 'float' within a float32, not 'float' (3.5e+38)"),
        ("int32", 1.0, "of type 'int' in [-2147483648, 2147483647], not 'float' (1.0); write int(...)"),
        ("uint8", 256, "of type 'int' in [0, 255], not 'int' (256)"),
        ("uint8", -1, "of type 'int' in [0, 255], not 'int' (-1)"),
        ("uint64", 2**64, "of type 'int' in [0, 18446744073709551615], not 'int' (18446744073709551616)"),
        ("int32", np.int64(1), "of type 'int' in [-2147483648, 2147483647], not 'int64' (np.int64(1)); write int(...)"),
        ("bool", 1, "of type 'bool', not 'int' (1)"),
        ("bool", np.True_, "of type 'bool', not 'bool' (np.True_); write bool(...)"),
        ("string", b"x", "of type 'str', not 'bytes' (b'x')"),
        ("string<=2", "abc", "of type 'str' of at most 2 characters, not 'str' ('abc')"),
        ("byte", b"ab", "of type 'int' in [0, 255], not 'bytes' (b'ab')"),
        ("geometry_msgs/Point", VECTOR(), "a sub message of type 'Point', not 'Vector3' (geometry_msgs.msg.Vector3("),
        ("float64[]", 1.0, "a sequence of values of type 'float', not 'float' (1.0)"),
        ("string[]", "ab", "a sequence of values of type 'str', not 'str' ('ab')"),
        ("float64[2]", [1.0], "a sequence of exactly 2 values of type 'float', not of 1 values"),
        ("float64[<=2]", [1.0] * 3, "a sequence of at most 2 values of type 'float', not of 3 values"),
        ("float64[]", np.array(1.0), "a sequence of values of type 'float', not 'ndarray' (array(1.))"),
    ],
    ids=str,
)
def test_a_value_that_does_not_fit_is_told(kind: str, value: Any, reason: str) -> None:
    told = refused(made(f"{kind} some")(), "some", value)
    assert told.startswith(f"The 'some' field of t.msg.T must be {reason}")


@pytest.mark.parametrize(
    ("kind", "values", "reason"),
    [
        ("float64[]", [1.0, 2], "[1]' field of t.msg.T must be of type 'float', not 'int' (2); write 2.0"),
        ("float64[]", np.array([1, 2]), "[0]' field of t.msg.T must be of type 'float', not 'int' (1)"),
        ("float64[]", np.zeros((2, 2)), "[0]' field of t.msg.T must be of type 'float', not 'list' ([0.0, 0.0])"),
        ("uint8[]", [1, 256], "[1]' field of t.msg.T must be of type 'int' in [0, 255], not 'int' (256)"),
        ("string[2]", ["a", 3], "[1]' field of t.msg.T must be of type 'str', not 'int' (3)"),
        ("geometry_msgs/Point[]", [VECTOR()], "[0]' field of t.msg.T must be a sub message of type 'Point', not 'Vec"),
    ],
    ids=str,
)
def test_an_element_that_does_not_fit_is_told_with_its_place(kind: str, values: Any, reason: str) -> None:
    assert refused(made(f"{kind} some")(), "some", values).startswith(f"The 'some{reason}")


class Text(str):
    """A text of another class."""


@pytest.mark.parametrize(
    ("kind", "value", "held"),
    [
        ("float64", np.float64(0.5), 0.5),
        ("int32", True, 1),
        ("byte", b"\x07", 7),
        ("string", Text("x"), "x"),
        ("float32", float("inf"), float("inf")),
        ("uint64", 2**64 - 1, 2**64 - 1),
        ("float64[2]", (1.0, np.float64(2)), [1.0, 2.0]),
        ("float64[2]", np.array([1.0, 2.0]), [1.0, 2.0]),
        ("float32[1]", np.array([0.5], "float32"), [0.5]),
        ("uint8[2]", b"\x01\xff", [1, 255]),
        ("bool[]", [True, False], [True, False]),
        ("byte[]", [b"\x01", 2], [1, 2]),
        ("string<=2[]", ("ab",), ["ab"]),
    ],
    ids=str,
)
def test_a_value_is_held_as_a_plain_one(kind: str, value: Any, held: Any) -> None:
    message = made(f"{kind} some")(some=value)
    assert message.some == held
    for inner, plain in [(message.some, held), *(zip(message.some, held, strict=True) if "]" in kind else ())]:
        assert type(inner) is type(plain)


def test_a_list_of_numbers_is_copied_and_one_of_messages_is_the_one_that_was_given() -> None:
    numbers, names, points = [1.0], ["a"], [generated.find("geometry_msgs/msg/Point")()]
    state = JOINTS(name=names, position=numbers)
    numbers.append(2.0)
    names.append("b")
    assert (state.position, state.name) == (doubles(1.0), ["a", "b"])
    assert made("geometry_msgs/Point[] all")(all=points).all is points


def test_types_are_spelled_as_in_ros() -> None:
    text = "bool a\nbyte b\nchar c\nfloat32 d\nfloat64[3] e\nstring<=5[] f\ngeometry_msgs/Point[<=4] g\nint8[] h"
    assert list(made(text).get_fields_and_field_types().values()) == [
        "boolean", "octet", "uint8", "float", "double[3]", "sequence<string<5>>", "sequence<geometry_msgs/Point, 4>",
        "sequence<int8>",
    ]  # fmt: skip


def test_a_service_has_two_messages_and_no_values() -> None:
    trigger = generated.find("std_srvs/srv/Trigger")
    assert repr(trigger.Response(message="x")) == "std_srvs.srv.Trigger_Response(success=False, message='x')"
    assert trigger.Request is generated.find("std_srvs/srv/Trigger_Request")
    assert trigger.ROS == trigger.Request.ROS == trigger.Response.ROS == "std_srvs/srv/Trigger"
    assert generated.find("nav_msgs/srv/LoadMap").Response.RESULT_INVALID_MAP_DATA == 2
    with pytest.raises(NotImplementedError, match=r"make a Trigger\.Request\(\)"):
        trigger()
    with pytest.raises(InterfaceError, match="t/msg/T is no service"):
        generated.make_service(Interface("t/msg/T", "msg"))


def test_a_message_that_ends_in_request_is_no_service() -> None:
    assert made("int8 a", "t/msg/My_Request").ROS == "t/msg/My_Request"


def test_a_class_is_made_once_for_each_definition() -> None:
    assert generated.find("geometry_msgs/msg/Twist") is TWIST
    assert type(TWIST().linear) is VECTOR
    assert generated.make(Registry().find("geometry_msgs/msg/Twist")) is TWIST
    assert made("int8 a") is made("int8 a")
    assert made("int8 a") is not made("int8 a 1")
    assert made("int8 a") is not made("int8 a\nint8 B=1")


@pytest.mark.parametrize(
    "member", [Field("lambda", "int8"), Field("get_fields_and_field_types", "int8"), Constant("ROS", "int8", 1)]
)
def test_a_name_that_no_class_can_have_is_told(member: Any) -> None:
    halves = ((member,), ()) if isinstance(member, Field) else ((), (member,))
    with pytest.raises(InterfaceError, match=f"^t/msg/T: '{member.name}' is a word"):
        generated.make(Interface("t/msg/T", "msg", *halves))


def test_the_comparison_with_another_type_is_false() -> None:
    assert not operator.eq(VECTOR(), generated.find("geometry_msgs/msg/Point")())
