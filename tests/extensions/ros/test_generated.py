"""Generated classes take, hold and print what ROS's do."""

import array
import copy
import json
import math
import operator
import pickle
import struct
from typing import Any

import msgspec
import numpy as np
import pytest

from holozen import messages as m
from holozen.messages import struct_cdr
from holozen.messages.cdr import Codec, Shape
from holozen.messages.codec import WIRES, CodecError, convert, decode, encode, encoding
from holozen.messages.definitions import Constant, Field, Interface, InterfaceError
from holozen.messages.registry import Registry
from holozen.ros import generated
from tests.extensions.ros.classes import made, refused

TWIST, VECTOR = (
    generated.find("geometry_msgs/msg/Twist"),
    generated.find("geometry_msgs/msg/Vector3"),
)
JOINTS, TIME = (
    generated.find("sensor_msgs/msg/JointState"),
    generated.find("builtin_interfaces/msg/Time"),
)


def doubles(*values: float) -> "array.array[float]":
    return array.array("d", values)


def test_a_twist_is_made_changed_compared_and_shown_as_in_ros() -> None:
    twist = TWIST(linear=VECTOR(x=0.5))
    twist.angular.z = -1.0
    assert (
        repr(twist)
        == str(twist)
        == (
            "geometry_msgs.msg.Twist(linear=geometry_msgs.msg.Vector3(x=0.5, y=0.0, z=0.0),"
            " angular=geometry_msgs.msg.Vector3(x=0.0, y=0.0, z=-1.0))"
        )
    )
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
        'int32 TOP=7\nstring WORD="hi"\nint8 a -3\nstring b "x"\nfloat32[2] c [1, 2]\nbool[] d '
        "[true]\nbyte e 1"
    )
    message = kind()
    assert (kind.TOP, message.TOP, kind.WORD) == (7, 7, "hi")
    assert (message.a, message.b, message.c, message.d, message.e) == (
        -3,
        "x",
        [1.0, 2.0],
        [True],
        1,
    )
    message.c[0] = 9.0
    assert kind().c == [1.0, 2.0]
    with pytest.raises(AttributeError, match="has no field 'TOP'"):
        message.TOP = 8


def test_fields_are_given_by_their_names_only() -> None:
    with pytest.raises(
        TypeError,
        match=r"^geometry_msgs\.msg\.Twist takes its fields by name: Twist\(linear=..., ang",
    ):
        TWIST(VECTOR())
    with pytest.raises(
        AssertionError,
        match=r"geometry_msgs\.msg\.Twist has no field 'linaer' \(did you mean 'linear'\?\)$",
    ):
        TWIST(linaer=VECTOR())
    with pytest.raises(
        AttributeError, match=r"^geometry_msgs\.msg\.Vector3 has no field 'q'; it has x, y, z$"
    ):
        TWIST().linear.q = 1.0
    with pytest.raises(
        AttributeError,
        match=r"^nav_msgs\.msg\.Odometry has no field 'linear'; it has header, child_",
    ):
        generated.find("nav_msgs/msg/Odometry")().linear  # noqa: B018
    with pytest.raises(AttributeError, match="has no field 'x'; it has none"):
        generated.find("std_msgs/msg/Empty")().x = 1


def test_a_value_that_does_not_fit_is_reported() -> None:
    for kind, value, reason in [
        ("float64", 1, "of type 'float', not 'int' (1); write 1.0, or float(...)"),
        (
            "float64",
            np.float32(1),
            "of type 'float', not 'float32' (np.float32(1.0)); write float(...)",
        ),
        ("float64", "1", "of type 'float', not 'str' ('1')"),
        ("float64", None, "of type 'float', not 'NoneType' (None)"),
        ("float32", 3.5e38, "of type 'float' within a float32, not 'float' (3.5e+38)"),
        (
            "int32",
            1.0,
            "of type 'int' in [-2147483648, 2147483647], not 'float' (1.0); write int(...)",
        ),
        ("uint8", 256, "of type 'int' in [0, 255], not 'int' (256)"),
        ("uint8", -1, "of type 'int' in [0, 255], not 'int' (-1)"),
        (
            "uint64",
            2**64,
            "of type 'int' in [0, 18446744073709551615], not 'int' (18446744073709551616)",
        ),
        (
            "int32",
            np.int64(1),
            "of type 'int' in [-2147483648, 2147483647], not 'int64' (np.int64(1)); write int(...)",
        ),
        ("bool", 1, "of type 'bool', not 'int' (1)"),
        ("bool", np.True_, "of type 'bool', not 'bool' (np.True_); write bool(...)"),
        ("string", b"x", "of type 'str', not 'bytes' (b'x')"),
        ("string<=2", "abc", "of type 'str' of at most 2 characters, not 'str' ('abc')"),
        ("byte", b"ab", "of type 'int' in [0, 255], not 'bytes' (b'ab')"),
        (
            "geometry_msgs/Point",
            VECTOR(),
            "a sub message of type 'Point', not 'Vector3' (geometry_msgs.msg.Vector3(",
        ),
        ("float64[]", 1.0, "a sequence of values of type 'float', not 'float' (1.0)"),
        ("string[]", "ab", "a sequence of values of type 'str', not 'str' ('ab')"),
        ("float64[2]", [1.0], "a sequence of exactly 2 values of type 'float', not of 1 values"),
        (
            "float64[<=2]",
            [1.0] * 3,
            "a sequence of at most 2 values of type 'float', not of 3 values",
        ),
        (
            "float64[]",
            np.array(1.0),
            "a sequence of values of type 'float', not 'ndarray' (array(1.))",
        ),
    ]:
        expected = refused(made(f"{kind} some")(), "some", value)
        assert expected.startswith(f"The 'some' field of t.msg.T must be {reason}")


def test_an_element_that_does_not_fit_is_reported_with_its_place() -> None:
    for kind, values, reason in [
        (
            "float64[]",
            [1.0, 2],
            "[1]' field of t.msg.T must be of type 'float', not 'int' (2); write 2.0",
        ),
        (
            "float64[]",
            np.array([1, 2]),
            "[0]' field of t.msg.T must be of type 'float', not 'int' (1)",
        ),
        (
            "float64[]",
            np.zeros((2, 2)),
            "[0]' field of t.msg.T must be of type 'float', not 'list' ([0.0, 0.0])",
        ),
        (
            "uint8[]",
            [1, 256],
            "[1]' field of t.msg.T must be of type 'int' in [0, 255], not 'int' (256)",
        ),
        ("string[2]", ["a", 3], "[1]' field of t.msg.T must be of type 'str', not 'int' (3)"),
        (
            "geometry_msgs/Point[]",
            [VECTOR()],
            "[0]' field of t.msg.T must be a sub message of type 'Point', not 'Vec",
        ),
    ]:
        assert refused(made(f"{kind} some")(), "some", values).startswith(f"The 'some{reason}")
    message = refused(made("geometry_msgs/Quaternion some")(), "some", (0.0, 0.0, 0.0, 1.0))
    assert message.endswith("; write Quaternion(x=..., y=..., z=..., w=...)")


class Text(str):
    """A text of another class."""


def test_a_value_is_held_as_a_plain_one() -> None:
    rows: list[tuple[str, Any, Any]] = [
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
    ]
    for kind, value, held in rows:
        message = made(f"{kind} some")(some=value)
        assert message.some == held
        for inner, plain in [
            (message.some, held),
            *(zip(message.some, held, strict=True) if "]" in kind else ()),
        ]:
            assert type(inner) is type(plain)


def test_a_list_of_numbers_is_copied_and_one_of_messages_is_the_one_that_was_given() -> None:
    numbers, names, points = [1.0], ["a"], [generated.find("geometry_msgs/msg/Point")()]
    state = JOINTS(name=names, position=numbers)
    numbers.append(2.0)
    names.append("b")
    assert (state.position, state.name) == (doubles(1.0), ["a", "b"])
    assert made("geometry_msgs/Point[] all")(all=points).all is points


def test_types_are_spelled_as_in_ros() -> None:
    text = (
        "bool a\nbyte b\nchar c\nfloat32 d\nfloat64[3] e\nstring<=5[] "
        "f\ngeometry_msgs/Point[<=4] g\nint8[] h"
    )
    assert list(made(text).get_fields_and_field_types().values()) == [
        "boolean",
        "octet",
        "uint8",
        "float",
        "double[3]",
        "sequence<string<5>>",
        "sequence<geometry_msgs/Point, 4>",
        "sequence<int8>",
    ]


def test_a_service_has_two_messages_and_no_values() -> None:
    trigger = generated.find("std_srvs/srv/Trigger")
    assert (
        repr(trigger.Response(message="x"))
        == "std_srvs.srv.Trigger_Response(success=False, message='x')"
    )
    assert trigger.Request is generated.find("std_srvs/srv/Trigger_Request")
    assert trigger.ROS == trigger.Request.ROS == trigger.Response.ROS == "std_srvs/srv/Trigger"
    assert generated.find("nav_msgs/srv/LoadMap").Response.RESULT_INVALID_MAP_DATA == 2
    with pytest.raises(NotImplementedError, match=r"create a Trigger\.Request\(\)"):
        trigger()


def test_a_message_that_ends_in_request_is_no_service() -> None:
    assert made("int8 a", "t/msg/My_Request").ROS == "t/msg/My_Request"


def test_a_class_is_made_once_for_each_definition() -> None:
    assert generated.find("geometry_msgs/msg/Twist") is TWIST
    assert type(TWIST().linear) is VECTOR
    assert generated.make(Registry().find("geometry_msgs/msg/Twist")) is TWIST
    assert made("int8 a") is made("int8 a")
    assert made("int8 a") is not made("int8 a 1")
    assert made("int8 a") is not made("int8 a\nint8 B=1")


def test_a_name_that_no_class_can_have_is_reported() -> None:
    members: list[Any] = [
        Field("lambda", "int8"),
        Field("get_fields_and_field_types", "int8"),
        Constant("ROS", "int8", 1),
    ]
    for member in members:
        halves = ((member,), ()) if isinstance(member, Field) else ((), (member,))
        with pytest.raises(InterfaceError, match=f"^t/msg/T: '{member.name}' is reserved"):
            generated.make(Interface("t/msg/T", "msg", *halves))


def test_the_comparison_with_another_type_is_false() -> None:
    assert not operator.eq(VECTOR(), generated.find("geometry_msgs/msg/Point")())


IMAGE, SCAN = generated.find("sensor_msgs/msg/Image"), generated.find("sensor_msgs/msg/LaserScan")
CODES = {
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
WIDTHS = {"char": "u1", "float32": "f4", "float64": "f8"}  # as numpy names them


def same(value: Any, code: str, held: Any) -> bool:
    return type(value) is array.array and (value.typecode, value.tolist()) == (code, held)


def test_a_sequence_of_numbers_is_an_array_whatever_it_is_made_of() -> None:
    for kind in CODES:
        for bound in ["", "<=3"]:
            message, code, width = (
                made(f"{kind}[{bound}] some")(),
                CODES[kind],
                WIDTHS.get(kind, kind),
            )
            assert same(message.some, code, [])
            held: list[Any] = [1.0, 2.0, 0.5] if code in "fd" else [1, 2, 3]
            numbers: Any = np.array(held, width)
            swapped = numbers.astype(numbers.dtype.newbyteorder())
            for value in (
                held,
                tuple(held),
                array.array(code, held),
                numbers,
                numbers.repeat(2)[::2],
                memoryview(numbers),
                swapped,
            ):
                message.some = value
                assert same(message.some, code, held), value
                for wire in WIRES:
                    read: Any = decode(
                        encode(message, wire), encoding(wire, type(message)), (type(message),)
                    )
                    assert same(read.some, code, held)
                    assert read == message


def test_an_image_is_what_scripts_with_numpy_take_and_give() -> None:
    pixels = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    for data in (
        pixels.tobytes(),
        bytearray(pixels.tobytes()),
        pixels.ravel(),
        pixels.flatten().tolist(),
    ):
        image = IMAGE(height=2, width=2, data=data)
        assert (np.frombuffer(image.data, dtype=np.uint8).reshape(2, 2, 3) == pixels).all()
        assert image.data.tobytes() == pixels.tobytes()
    scan = SCAN(ranges=np.array([1.0, math.inf], np.float32))
    assert scan.ranges.tolist() == [1.0, math.inf]
    assert np.isinf(np.array(scan.ranges)).tolist() == [False, True]


def test_the_rest_are_lists() -> None:
    for kind in [
        "bool[]",
        "byte[]",
        "string[]",
        "geometry_msgs/Point[]",
        "float64[2]",
        "uint8[<=3]",
    ]:
        message = made(f"{kind} some")()
        assert (type(message.some) is list) is (kind != "uint8[<=3]")
        read: Any = decode(encode(message, "cdr"), WIRES["cdr"], (type(message),))
        assert type(read.some) is type(message.some)


def test_an_array_is_the_one_that_was_given_unless_it_has_another_typecode() -> None:
    ranges = array.array("f", [1.0])
    scan = SCAN(ranges=ranges)
    assert scan.ranges is ranges
    scan.ranges = array.array("d", [0.1])
    assert same(scan.ranges, "f", [np.float32(0.1)])


def test_what_no_array_of_its_type_holds_is_reported() -> None:
    rows = [
        (
            "uint8[]",
            "ab",
            "' field of t.msg.T must be a sequence of values of type 'int' in [0, 255], not 'str'",
        ),
        (
            "uint8[]",
            3,
            "' field of t.msg.T must be a sequence of values of type 'int' in [0, 255], not 'int'",
        ),
        (
            "int8[]",
            b"\xff",
            "[0]' field of t.msg.T must be of type 'int' in [-128, 127], not 'int' (255)",
        ),
        (
            "int8[]",
            array.array("i", [1, 128]),
            "[1]' field of t.msg.T must be of type 'int' in [-128, 127], ",
        ),
        (
            "uint8[]",
            np.zeros((1, 2), np.uint8),
            "[0]' field of t.msg.T must be of type 'int' in [0, 255], not 'list'",
        ),
        (
            "uint8[]",
            np.array([1.0]),
            "[0]' field of t.msg.T must be of type 'int' in [0, 255], not 'float' (1.0)",
        ),
        (
            "float32[]",
            array.array("i", [1]),
            "[0]' field of t.msg.T must be of type 'float' within a float32, ",
        ),
        (
            "float32[]",
            [0.0, 1e39],
            "[1]' field of t.msg.T must be of type 'float' within a float32, not ",
        ),
        (
            "float32[]",
            np.array([1e39]),
            "[0]' field of t.msg.T must be of type 'float' within a float32, not ",
        ),
        (
            "float64[]",
            np.array([True]),
            "[0]' field of t.msg.T must be of type 'float', not 'bool' (True)",
        ),
        (
            "uint8[<=2]",
            b"abc",
            "' field of t.msg.T must be a sequence of at most 2 values of type 'int', not of 3",
        ),
        (
            "uint8[<=2]",
            array.array("B", b"abc"),
            "' field of t.msg.T must be a sequence of at most 2 values of type ",
        ),
        (
            "uint8[]",
            np.array(["2020"], "datetime64[D]"),
            "[0]' field of t.msg.T must be of type 'int' in [0, 255], ",
        ),
    ]
    for kind, value, reason in rows:
        assert refused(made(f"{kind} some")(), "some", value).startswith(f"The 'some{reason}")


def test_a_repr_a_copy_and_a_pickle_are_those_of_a_message() -> None:
    scan = SCAN(ranges=[1.5, 2.0])
    assert "ranges=[1.5, 2.0], intensities=[])" in repr(scan)
    for other in (copy.deepcopy(scan), pickle.loads(pickle.dumps(scan))):
        assert other == scan
        other.ranges.append(3.0)
        assert other != scan
        assert scan.ranges.tolist() == [1.5, 2.0]
    assert copy.copy(scan).ranges is scan.ranges


def test_no_two_messages_share_a_default() -> None:
    kind = made("int32[] some [1, 2]\nint32[] none")
    first = kind()
    assert same(first.some, "i", [1, 2])
    first.some.append(3)
    first.none.append(3)
    assert (kind().some.tolist(), kind().none.tolist()) == ([1, 2], [])


def test_an_array_itself_refuses_what_is_put_into_it() -> None:
    image = IMAGE()
    with pytest.raises(OverflowError):
        image.data.append(256)
    with pytest.raises(TypeError):
        image.data.append("a")
    assert same(image.data, "B", [])


def test_what_was_appended_beyond_a_bound_is_refused_when_it_is_written() -> None:
    for wire in WIRES:
        message = made("uint8[<=2] some")(some=b"ab")
        assert encode(message, wire)
        message.some.append(3)
        with pytest.raises(
            CodecError,
            match=r"^The 'some' field of t\.msg\.T must be a sequence of at most 2 values",
        ):
            encode(message, wire)


def test_numbers_from_the_wire_that_do_not_fit_are_reported_in_one_line() -> None:
    for kind, value, reason in [
        ("uint8[]", [1, 256], "not a T: Expected `int` <= 255 - at `$.some[1]`"),
        ("uint8[]", [True], "not a T: Expected `int`, got `bool` - at `$.some[0]`"),
        ("int64[]", [2**63], "not a T: "),
        ("uint64[]", [1, 2**64], "not a T: some[1] of 18446744073709551616 is too large"),
        ("uint64[]", [-1], "not a T: Expected `int` >= 0 - at `$.some[0]`"),
        ("float64[]", [None], "not a T: Expected `float`, got `null` - at `$.some[0]`"),
        ("float64[]", 3, "not a T: Expected `array`, got `int` - at `$.some`"),
        ("float32[]", [1.0, -1e39], "not a T: some[1] of -1e+39 is too large"),
        ("float32[<=1]", [1.0, 1.0], "not a T: Expected `array` of length <= 1 - at `$.some`"),
    ]:
        reader = made(f"{kind} some")
        with pytest.raises(CodecError) as error:
            decode(json.dumps({"some": value}).encode(), "", (reader,))
        assert str(error.value).startswith(reason)
        with pytest.raises(CodecError) as same_error:
            convert({"some": value}, (reader,))
        assert str(same_error.value).startswith("not a T: ")
        assert "\n" not in str(error.value) + str(same_error.value)


def test_cdr_that_is_cut_off_or_too_long_is_reported() -> None:
    for wrong in [b"\xff\xff\xff\xff", b"\5\0\0\0abcd", b"\3\0\0\0abc", b"\1\0"]:
        with pytest.raises(CodecError, match=r"^not a T: (a sequence of|cut off)"):
            decode(b"\0\1\0\0" + wrong, WIRES["cdr"], (made("uint8[<=2] some"),))


def test_both_byte_orders_of_cdr_are_read() -> None:
    for kind in CODES:
        for order in "<>":
            held, code = (
                [1, 2, 3] if CODES[kind] not in "fd" else [0.5, -math.inf, 2.0],
                CODES[kind],
            )
            gap = 4 if struct.calcsize(code) == 8 else 0  # 8 bytes stand before the first number
            kinds = (made(f"{kind}[] some"), made(f"int32 a\n{kind}[] some"))
            for reader, before in zip(kinds, (b"", b"\0" * 4), strict=True):
                numbers = struct.pack(f"{order}I{0 if before else gap}x3{code}", 3, *held)
                read: Any = decode(
                    b"\0" + (b"\0" if order == ">" else b"\1") + b"\0\0" + before + numbers,
                    WIRES["cdr"],
                    (reader,),
                )
                assert same(read.some, code, held)


def test_cdr_is_read_into_an_array_without_a_list_between() -> None:
    shape = Shape()
    shape.arrays = True
    read = Codec(struct_cdr.interface(SCAN), shape).read(encode(SCAN(ranges=[0.5]), "cdr"))
    assert same(read["ranges"], "f", [0.5])


def test_our_own_message_is_the_same_bytes() -> None:
    for wire in WIRES:
        ours = m.JointState(name=["a"], position=[0.1, 2.0], effort=[1e300])
        theirs: Any = generated.find(ours.ROS)(
            name=["a"], position=[0.1, 2.0], effort=np.array([1e300])
        )
        assert encode(theirs, wire) == encode(ours, wire)
        numpys: dict[str, Any] = {"position": np.array([0.1, 2.0]), "effort": [np.float64(1e300)]}
        assert encode(m.JointState(name=["a"], **numpys), wire) == encode(ours, wire)
        numpys["velocity"] = [np.float32("nan")]
        with pytest.raises(CodecError, match=r"^JointState.velocity\[0\] is not a finite number$"):
            encode(m.JointState(**numpys), wire)
        read = decode(encode(ours, wire), encoding(wire, m.JointState), (m.JointState,))
        assert type(read.position) is list


def test_an_array_is_nothing_for_a_field_of_another_type() -> None:
    with pytest.raises(TypeError, match=r"^a message cannot hold a complex$"):
        encode(m.TriggerReply(message=1j))  # type: ignore[arg-type]
    assert msgspec.json.decode(encode(IMAGE(data=b"\1\2")))["data"] == [1, 2]
