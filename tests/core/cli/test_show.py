"""Values are shown as people read them, whatever the bytes are."""

import json
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from holozen.messages import Twist
from holozen.messages.codec import encode
from holozen.output import MAX_ON_A_LINE, Hex, decode, lines

JSON = "application/json"
leaves = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats() | st.text()
values = st.recursive(
    leaves, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=20
)


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
    assert lines([0] * MAX_ON_A_LINE) == [f"[{', '.join(['0'] * 128)}]"]
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


def test_a_value_nested_too_deeply_to_indent_is_shown_on_one_line() -> None:
    text = '{"a": ' * 500 + "1" + "}" * 500
    assert lines(decode(text.encode(), JSON)) == [text]


@given(values)
def test_any_json_is_shown_in_printable_lines_and_as_json(value: Any) -> None:
    shown = decode(json.dumps(value).encode(), JSON)
    json.dumps(shown)
    assert all(line.isprintable() for line in lines(shown))


@given(st.binary(), st.sampled_from([JSON, "text/plain", "zenoh/bytes"]))
def test_any_bytes_are_shown(payload: bytes, encoding: str) -> None:
    shown = decode(payload, encoding)
    json.dumps(shown)
    assert all(line.isprintable() for line in lines(shown))
