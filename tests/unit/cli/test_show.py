"""Values are shown as people read them, whatever the bytes are."""

import datetime
import json
import math
from typing import Any

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from holozen.cli.output import LONGEST, Hex, decode, lines
from holozen.messages import Odometry, Twist
from holozen.messages.codec import encode

JSON, MSGPACK = "application/json", "application/msgpack"
keys = st.text() | st.integers(-(2**63), 2**63) | st.binary(max_size=4)
leaves = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats() | st.text() | st.binary()
values = st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(keys, inner), max_leaves=20)


def test_a_message_is_laid_out_as_ros_2_does() -> None:
    assert lines(decode(encode(Twist.planar(0.5, 0.0, -1.0)), JSON)) == [
        "linear:",
        "  x: 0.5",
        "  y: 0.0",
        "  z: 0.0",
        "angular:",
        "  x: 0.0",
        "  y: 0.0",
        "  z: -1.0",
    ]


def test_both_wires_look_the_same() -> None:
    odom = Odometry(child_frame_id="base")
    assert decode(encode(odom), JSON) == decode(encode(odom, "msgpack"), MSGPACK)
    assert "child_frame_id: base" in lines(decode(encode(odom, "msgpack"), f"{MSGPACK};nav_msgs/msg/Odometry"))


def test_values_are_shown() -> None:
    for value, shown in [
        ({}, ["{}"]),
        ([], ["[]"]),
        ({"a": {}}, ["a: {}"]),
        ({"a": []}, ["a: []"]),
        ({"a": [1, 2.5]}, ["a: [1, 2.5]"]),
        ({"a": [[1], [2]]}, ["a:", "  - [1]", "  - [2]"]),
        ({"a": [{"b": 1, "c": {"d": 2}}]}, ["a:", "  - b: 1", "    c:", "      d: 2"]),
        ([{"a": 1}, [], {}], ["- a: 1", "- []", "- {}"]),
        ([[[1], 2], 3], ["- - [1]", "  - 2", "- 3"]),
        (None, ["null"]),
        (True, ["true"]),
        (math.nan, ["NaN"]),
        ("text", ["text"]),
        ("", ['""']),
        ("two\nlines\x1b[2J", ['"two\\nlines\\u001b[2J"']),
        ({"two\nlines": 1}, ['"two\\nlines": 1']),
        ({"": {"a": 1}}, ['"":', "  a: 1"]),
    ]:
        assert lines(value) == shown


def test_a_long_list_is_cut_where_ros_2_cuts_it() -> None:
    assert lines([0] * LONGEST) == [f"[{', '.join(['0'] * 128)}]"]
    assert lines(list(range(1000)))[0].endswith(", 126, 127, ... 872 more]")
    assert lines({"a": list(range(9))}, longest=2) == ["a: [0, 1, ... 7 more]"]
    assert lines(list(range(1000)), longest=0)[0].endswith(", 998, 999]")


def test_text_that_is_no_json_is_shown_as_it_is() -> None:
    assert decode(b"hello there", "text/plain") == "hello there"
    assert decode(b"", "zenoh/bytes") == ""
    assert not isinstance(decode(b"hello", ""), Hex)
    assert decode(b"[" * 100_000, JSON) == "[" * 100_000


def test_bytes_that_are_no_text_are_shown_as_a_hex_dump() -> None:
    assert isinstance(decode(b"\x89PNG", "image/png"), Hex)
    assert decode(b"\0\1\0\0\0\0", "zenoh/bytes") == "6 bytes of zenoh/bytes: 00 01 00 00 00 00"
    assert decode(b"\x89PNG", "image/png") == "4 bytes of image/png: 89 50 4e 47"
    assert decode(b"\xff" * 33, "zenoh/bytes") == f"33 bytes of zenoh/bytes: {'ff ' * 31}ff ..."
    assert decode(b"\xff" * 32, "zenoh/bytes").endswith(" ff")
    assert decode(b"\xa1\xff", MSGPACK) == "2 bytes of application/msgpack: a1 ff"
    assert decode(b"\xc1", MSGPACK) == "1 bytes of application/msgpack: c1"
    assert decode(b"\x91" * 100_000, MSGPACK).startswith("100000 bytes of application/msgpack: 91 91")


def test_what_json_does_not_know_is_shown_as_text() -> None:
    now = datetime.datetime(2026, 1, 2, tzinfo=datetime.UTC)
    value = {"bytes": b"\x00\xff", "time": now, 7: {b"key": [b""]}, (1, 2): None}
    assert decode(msgspec.msgpack.encode(value), MSGPACK) == {
        "bytes": "00 ff",
        "time": "2026-01-02 00:00:00+00:00",
        "7": {"6b 65 79": [""]},
        "[1, 2]": None,
    }


def test_a_value_nested_too_deeply_to_indent_is_shown_on_one_line() -> None:
    text = '{"a": ' * 500 + "1" + "}" * 500
    assert lines(decode(text.encode(), JSON)) == [text]


@given(values)
def test_any_msgpack_is_shown_in_printable_lines_and_as_json(value: Any) -> None:
    shown = decode(msgspec.msgpack.encode(value), MSGPACK)
    json.dumps(shown)
    assert all(line.isprintable() for line in lines(shown))


@given(st.binary(), st.sampled_from([JSON, MSGPACK, "text/plain", "zenoh/bytes"]))
def test_any_bytes_are_shown(payload: bytes, encoding: str) -> None:
    shown = decode(payload, encoding)
    json.dumps(shown)
    assert all(line.isprintable() for line in lines(shown))
