"""CDR is byte for byte what an independent library writes, and bad bytes are refused in one
line.
"""

import itertools
import math
import tracemalloc
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holozen.messages import CodecError, cdr
from holozen.messages.definitions import INTEGERS, Field, Interface, prototype
from holozen.messages.registry import Registry
from tests.core.messages.conftest import Rosbags
from tests.core.messages.strategies import values

REGISTRY = Registry()
NAMES = [name for name in REGISTRY.names() if "/msg/" in name]
SOME = [
    "geometry_msgs/msg/Twist",
    "nav_msgs/msg/Odometry",
    "tf2_msgs/msg/TFMessage",
    "sensor_msgs/msg/JointState",
    "rosgraph_msgs/msg/Clock",
    "sensor_msgs/msg/BatteryState",
    "visualization_msgs/msg/Marker",
    "std_msgs/msg/Empty",
    "std_srvs/srv/Trigger_Request",
    "holozen/msg/CommandStatus",
    "simulation_interfaces/srv/SpawnEntity_Request",
]
KINDS = (
    "bool",
    "byte",
    "char",
    *(kind for kind in INTEGERS if "int" in kind),
    "float32",
    "float64",
    "string",
)
SECOND = ("uint8", "int16", "float32", "float64", "string")  # one of each alignment
ARRAYS = (("", 0), ("fixed", 3), ("sequence", 0), ("bounded", 5))


def odd_types() -> list[Interface]:
    """Types whose fields lie at odd places: each kind after a byte, before one of each
    alignment, in every kind of array, and nested.
    """
    made = []
    for number, (first, second) in enumerate(itertools.product(KINDS, SECOND)):
        array, bound = ARRAYS[number % 4]
        fields = (
            Field("a", "uint8"),
            Field("b", first, array, bound),
            Field("c", "bool"),
            Field("d", second),
        )
        made.append(Interface(f"odd/msg/Pair{number}", "msg", fields))
    inner, empty = made[7], Interface("odd/msg/Nothing", "msg")
    for array, bound in ARRAYS:
        nested = (
            Field("a", "uint8"),
            Field("b", inner.name, array, bound, nested=inner),
            Field("c", "uint8"),
            Field("d", empty.name, array, bound, nested=empty),
            Field("e", "float64"),
        )
        made.append(Interface(f"odd/msg/Nested{array.title()}", "msg", nested))
    return made


ODD = odd_types()
TOGETHER = 10  # of these have their values drawn at once, which is quicker


def test_another_library_writes_and_reads_the_same_bytes(rosbags: Rosbags) -> None:
    """Types of every kind with 6 values each; and fields at odd places, which are aligned, with
    2.
    """

    def agree(interface: Interface, value: dict[str, Any]) -> None:
        payload = cdr.write(interface, value)
        assert payload == rosbags.write(interface, value), interface.name
        assert cdr.read(interface, payload) == value == rosbags.read(interface, payload), (
            interface.name
        )
        assert cdr.read(interface, rosbags.write(interface, value, little_endian=False)) == value, (
            interface.name
        )

    def agree_all(drawn: tuple[tuple[Interface, dict[str, Any]], ...]) -> None:
        for interface, value in drawn:
            agree(interface, value)

    for name in SOME:
        interface = REGISTRY.find(name)
        settings(max_examples=6)(given(st.just(interface), values(interface))(agree))()
    for first in range(0, len(ODD), TOGETHER):
        some = [st.tuples(st.just(odd), values(odd)) for odd in ODD[first : first + TOGETHER]]
        settings(max_examples=2)(given(st.tuples(*some))(agree_all))()


def test_the_prototype_of_every_type_is_the_same_bytes(rosbags: Rosbags) -> None:
    for name in NAMES:
        interface = REGISTRY.find(name)
        value = prototype(interface)
        assert cdr.write(interface, {}) == rosbags.write(interface, value), name
        assert (
            cdr.read(interface, cdr.write(interface, {}))
            == value
            == rosbags.read(interface, cdr.write(interface, {}))
        )


def test_the_bytes_of_a_text_after_a_byte_are_these() -> None:
    interface = Interface(
        "t/msg/T", "msg", (Field("a", "uint8"), Field("b", "string"), Field("c", "float64"))
    )
    payload = bytes.fromhex(
        "00010000 07000000 03000000 6869 00 00 00000000000000000000f03f".replace(" ", "")
    )
    assert cdr.write(interface, {"a": 7, "b": "hi", "c": 1.0}) == payload
    assert cdr.read(interface, payload) == {"a": 7, "b": "hi", "c": 1.0}


def test_nan_and_infinities_are_values() -> None:
    twist = REGISTRY.find("geometry_msgs/msg/Twist")
    linear = cdr.read(
        twist, cdr.write(twist, {"linear": {"x": math.nan, "y": math.inf, "z": -math.inf}})
    )["linear"]
    assert math.isnan(linear["x"])
    assert (linear["y"], linear["z"]) == (math.inf, -math.inf)


def refusal(name: str, payload: bytes) -> str:
    interface = REGISTRY.find(name)
    with pytest.raises(CodecError) as error:
        cdr.read(interface, payload)
    message = str(error.value)
    assert message.startswith(f"not a {name}: ")
    assert len(message) < 200
    return message


LITTLE = b"\x00\x01\x00\x00"


def test_bad_bytes_are_refused_with_the_reason() -> None:
    for name, payload, reason in [
        ("std_msgs/msg/String", b"", "no bytes"),
        ("std_msgs/msg/String", b"\x00\x01", "2 bytes that begin with 00 01"),
        ("std_msgs/msg/String", b'{"data": "x"}', "13 bytes that begin with 7b 22"),
        (
            "std_msgs/msg/String",
            b"\x00\x07\x00\x00" + b"\0" * 8,
            "begin with 00 07; CDR begins with 00 00 or 00 01",
        ),
        ("std_msgs/msg/String", LITTLE, "cut off after 4 bytes"),
        (
            "std_msgs/msg/String",
            LITTLE + b"\xff\xff\xff\xff",
            "a text of 4294967295 bytes where 0 are left",
        ),
        (
            "std_msgs/msg/String",
            LITTLE + b"\2\0\0\0hi",
            "a text of 2 bytes that does not end in NUL",
        ),
        ("std_msgs/msg/String", LITTLE + b"\2\0\0\0\xff\0", "a text is not UTF-8"),
        (
            "sensor_msgs/msg/JointState",
            LITTLE + b"\0" * 8 + b"\1\0\0\0\0\0\0\0" + b"\xff" * 8,
            "a sequence of 4294967295 ",
        ),
        ("geometry_msgs/msg/Twist", LITTLE + b"\0" * 47, "cut off after 51 bytes"),
        ("geometry_msgs/msg/Twist", LITTLE + b"\0" * 52, "4 bytes too many"),
        (
            "std_msgs/msg/Float64MultiArray",
            LITTLE + b"\xff" * 16,
            "a sequence of 4294967295 where 12 bytes are left",
        ),
    ]:
        assert reason in refusal(name, payload)


def test_up_to_three_bytes_of_padding_may_follow() -> None:
    twist = REGISTRY.find("geometry_msgs/msg/Twist")
    for filled in range(4):
        assert cdr.read(twist, cdr.write(twist, {}) + b"\0" * filled) == prototype(twist)


def test_an_empty_message_may_have_no_byte_at_all() -> None:
    request = REGISTRY.find("std_srvs/srv/Trigger_Request")
    assert cdr.write(request, {}) == LITTLE + b"\0"
    assert cdr.read(request, LITTLE) == cdr.read(request, LITTLE + b"\0") == {}


def test_bounds_hold_when_read_and_when_written() -> None:
    fields = (Field("text", "string", longest=3), Field("list", "uint8", "bounded", 2))
    free = Interface(
        "t/msg/Free", "msg", (Field("text", "string"), Field("list", "uint8", "sequence"))
    )
    bound = Interface("t/msg/Bound", "msg", fields)
    assert cdr.read(bound, cdr.write(free, {"text": "abc", "list": [1, 2]})) == {
        "text": "abc",
        "list": [1, 2],
    }
    for value, reason in (
        ({"text": "abcd"}, "a text of 4 bytes; at most 3"),
        ({"list": [1, 2, 3]}, "3; at most 2"),
    ):
        with pytest.raises(CodecError, match=reason):
            cdr.read(bound, cdr.write(free, value))
        with pytest.raises(CodecError, match=next(iter(value))):
            cdr.write(bound, value)


@given(data=st.data())
def test_any_bytes_are_a_message_or_a_codec_error(data: st.DataObject) -> None:
    interface = REGISTRY.find(data.draw(st.sampled_from(SOME)))
    good = bytearray(cdr.write(interface, data.draw(values(interface))))
    for _ in range(data.draw(st.integers(0, 4))):
        good[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
    payload = data.draw(
        st.sampled_from((bytes(good), bytes(good[: data.draw(st.integers(0, len(good)))])))
        | st.binary().map(lambda end: LITTLE + end)
    )
    try:
        assert list(cdr.read(interface, payload)) == [field.name for field in interface.fields]
    except CodecError as error:
        assert "\n" not in str(error)


def test_a_huge_length_takes_no_memory() -> None:
    for element in ["std_msgs/Empty", "string", "uint8", "float64"]:
        nested = REGISTRY.find("std_msgs/msg/Empty") if "/" in element else None
        kind = nested.name if nested else element
        interface = Interface("t/msg/Many", "msg", (Field("all", kind, "sequence", nested=nested),))
        cdr.read(interface, cdr.write(interface, {}))
        tracemalloc.start()
        with pytest.raises(CodecError, match="a sequence of 4294967295 where 1000 bytes are left"):
            cdr.read(interface, LITTLE + b"\xff\xff\xff\xff" + b"\0" * 1000)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert most < 100_000


def test_a_service_is_no_message_but_its_halves_are() -> None:
    with pytest.raises(
        CodecError, match=r"std_srvs/srv/Trigger is a service; its messages are .*_Request"
    ):
        cdr.read(REGISTRY.find("std_srvs/srv/Trigger"), LITTLE)


def test_a_wstring_is_refused_by_name() -> None:
    interface = Interface("t/msg/Wide", "msg", (Field("text", "wstring"),))
    for act in (lambda: cdr.read(interface, LITTLE), lambda: cdr.write(interface, {})):
        with pytest.raises(CodecError, match="text: the implementations of ROS 2 do not agree"):
            act()


def test_a_wrong_value_is_reported_with_its_path() -> None:
    twist = REGISTRY.find("geometry_msgs/msg/Twist")
    with pytest.raises(CodecError, match=r"^linear\.x: 'fast' is not a valid float64$"):
        cdr.write(twist, {"linear": {"x": "fast"}})
    with pytest.raises(CodecError, match=r"has no field 'linaer' \(did you mean 'linear'\?\)$"):
        cdr.write(twist, {"linaer": {}})
