"""Sequences of numbers are arrays, as in ROS, and lists on every wire that has lists."""

import array
import copy
import json
import math
import pickle
import struct
from typing import Any

import msgspec
import numpy as np
import pytest

from holozen import messages as m
from holozen.cdr import structs
from holozen.cdr.codec import Codec
from holozen.cdr.source import Shape
from holozen.codec import WIRES, CodecError, convert, decode, encode, encoding
from holozen.ros import generated
from tests.unit.ros.test_generated import made, refused

IMAGE, SCAN = generated.find("sensor_msgs/msg/Image"), generated.find("sensor_msgs/msg/LaserScan")
CODES = {
    "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q",
    "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
WIDTHS = {"char": "u1", "float32": "f4", "float64": "f8"}  # as numpy names them


def same(value: Any, code: str, held: Any) -> bool:
    return type(value) is array.array and (value.typecode, value.tolist()) == (code, held)


@pytest.mark.parametrize("bound", ["", "<=3"])
@pytest.mark.parametrize("kind", CODES)
def test_a_sequence_of_numbers_is_an_array_whatever_it_is_made_of(kind: str, bound: str) -> None:
    message, code, width = made(f"{kind}[{bound}] some")(), CODES[kind], WIDTHS.get(kind, kind)
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
            read: Any = decode(encode(message, wire), encoding(wire, type(message)), (type(message),))
            assert same(read.some, code, held)
            assert read == message


def test_an_image_is_what_scripts_with_numpy_take_and_give() -> None:
    pixels = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    for data in (pixels.tobytes(), bytearray(pixels.tobytes()), pixels.ravel(), pixels.flatten().tolist()):
        image = IMAGE(height=2, width=2, data=data)
        assert (np.frombuffer(image.data, dtype=np.uint8).reshape(2, 2, 3) == pixels).all()
        assert image.data.tobytes() == pixels.tobytes()
    scan = SCAN(ranges=np.array([1.0, math.inf], np.float32))
    assert scan.ranges.tolist() == [1.0, math.inf]
    assert np.isinf(np.array(scan.ranges)).tolist() == [False, True]


@pytest.mark.parametrize("kind", ["bool[]", "byte[]", "string[]", "geometry_msgs/Point[]", "float64[2]", "uint8[<=3]"])
def test_the_rest_are_lists(kind: str) -> None:
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


@pytest.mark.parametrize(
    ("kind", "value", "reason"),
    [
        ("uint8[]", "ab", "' field of t.msg.T must be a sequence of values of type 'int' in [0, 255], not 'str'"),
        ("uint8[]", 3, "' field of t.msg.T must be a sequence of values of type 'int' in [0, 255], not 'int'"),
        ("int8[]", b"\xff", "[0]' field of t.msg.T must be of type 'int' in [-128, 127], not 'int' (255)"),
        ("int8[]", array.array("i", [1, 128]), "[1]' field of t.msg.T must be of type 'int' in [-128, 127], "),
        ("uint8[]", np.zeros((1, 2), np.uint8), "[0]' field of t.msg.T must be of type 'int' in [0, 255], not 'list'"),
        ("uint8[]", np.array([1.0]), "[0]' field of t.msg.T must be of type 'int' in [0, 255], not 'float' (1.0)"),
        ("float32[]", array.array("i", [1]), "[0]' field of t.msg.T must be of type 'float' within a float32, "),
        ("float32[]", [0.0, 1e39], "[1]' field of t.msg.T must be of type 'float' within a float32, not "),
        ("float32[]", np.array([1e39]), "[0]' field of t.msg.T must be of type 'float' within a float32, not "),
        ("float64[]", np.array([True]), "[0]' field of t.msg.T must be of type 'float', not 'bool' (True)"),
        ("uint8[<=2]", b"abc", "' field of t.msg.T must be a sequence of at most 2 values of type 'int', not of 3"),
        ("uint8[<=2]", array.array("B", b"abc"), "' field of t.msg.T must be a sequence of at most 2 values of type "),
        ("uint8[]", np.array(["2020"], "datetime64[D]"), "[0]' field of t.msg.T must be of type 'int' in [0, 255], "),
    ],
    ids=str,
)  # fmt: skip
def test_what_no_array_of_its_type_holds_is_told(kind: str, value: Any, reason: str) -> None:
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


@pytest.mark.parametrize("wire", WIRES)
def test_what_was_appended_beyond_a_bound_is_refused_when_it_is_written(wire: str) -> None:
    message = made("uint8[<=2] some")(some=b"ab")
    assert encode(message, wire)
    message.some.append(3)
    with pytest.raises(CodecError, match=r"^T\.some: 3 values is not what a uint8\[<=2\] holds$"):
        encode(message, wire)


@pytest.mark.parametrize(
    ("kind", "value", "reason"),
    [
        ("uint8[]", [1, 256], "not a T: Expected `int` <= 255 - at `$.some[1]`"),
        ("uint8[]", [True], "not a T: Expected `int`, got `bool` - at `$.some[0]`"),
        ("int64[]", [2**63], "not a T: "),
        ("uint64[]", [1, 2**64], "not a T: some[1] of 18446744073709551616 is too large"),
        ("uint64[]", [-1], "not a T: Expected `int` >= 0 - at `$.some[0]`"),
        ("float64[]", [None], "not a T: Expected `float`, got `null` - at `$.some[0]`"),
        ("float64[]", 3, "not a T: Expected `array`, got `int` - at `$.some`"),
        ("float32[]", [1.0, -1e39], "not a T: some[1] of -1e+39 is too large"),
        ("float32[<=1]", [1.0, 1.0], "not a T: Expected `array` of length <= 1 - at `$.some`"),
    ],
)
def test_numbers_from_the_wire_that_do_not_fit_are_told_in_one_line(kind: str, value: Any, reason: str) -> None:
    reader = made(f"{kind} some")
    with pytest.raises(CodecError) as error:
        decode(json.dumps({"some": value}).encode(), "", (reader,))
    assert str(error.value).startswith(reason)
    with pytest.raises(CodecError) as same_error:
        convert({"some": value}, (reader,))
    assert str(same_error.value).startswith("not a T: ")
    assert "\n" not in str(error.value) + str(same_error.value)


@pytest.mark.parametrize("wrong", [b"\xff\xff\xff\xff", b"\5\0\0\0abcd", b"\3\0\0\0abc", b"\1\0"])
def test_cdr_that_is_cut_off_or_too_long_is_told(wrong: bytes) -> None:
    with pytest.raises(CodecError, match=r"^not a T: (a sequence of|cut off)"):
        decode(b"\0\1\0\0" + wrong, WIRES["cdr"], (made("uint8[<=2] some"),))


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("kind", CODES)
def test_both_byte_orders_of_cdr_are_read(kind: str, order: str) -> None:
    held, code = [1, 2, 3] if CODES[kind] not in "fd" else [0.5, -math.inf, 2.0], CODES[kind]
    gap = 4 if struct.calcsize(code) == 8 else 0  # 8 bytes stand before the first number
    kinds = (made(f"{kind}[] some"), made(f"int32 a\n{kind}[] some"))
    for reader, before in zip(kinds, (b"", b"\0" * 4), strict=True):
        numbers = struct.pack(f"{order}I{0 if before else gap}x3{code}", 3, *held)
        read: Any = decode(
            b"\0" + (b"\0" if order == ">" else b"\1") + b"\0\0" + before + numbers, WIRES["cdr"], (reader,)
        )
        assert same(read.some, code, held)


def test_cdr_is_read_into_an_array_without_a_list_between() -> None:
    shape = Shape()
    shape.arrays = True
    read = Codec(structs.interface(SCAN), shape).read(encode(SCAN(ranges=[0.5]), "cdr"))
    assert same(read["ranges"], "f", [0.5])


@pytest.mark.parametrize("wire", WIRES)
def test_our_own_message_is_the_same_bytes(wire: str) -> None:
    ours = m.JointState(name=["a"], position=[0.1, 2.0], effort=[1e300])
    theirs: Any = generated.find(ours.ROS)(name=["a"], position=[0.1, 2.0], effort=np.array([1e300]))
    assert encode(theirs, wire) == encode(ours, wire)
    read = decode(encode(ours, wire), encoding(wire, m.JointState), (m.JointState,))
    assert type(read.position) is list


def test_an_array_is_nothing_for_a_field_of_another_type() -> None:
    with pytest.raises(TypeError, match=r"^a complex is nothing that a message holds$"):
        encode(m.TriggerReply(message=1j))  # type: ignore[arg-type]
    assert msgspec.json.decode(encode(IMAGE(data=b"\1\2")))["data"] == [1, 2]
