"""Bytes and messages: both wires carry every message, and what is none is refused in one line."""

import math
import struct
import subprocess
import sys
import typing
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holozen import messages as m
from holozen.messages.codec import WIRES, CodecError, convert, decode, encode, written
from holozen.messages.message import not_finite
from holozen.wire import SERVICES, TOPICS

TYPES = {kind for row in TOPICS for kind in row.types} | {
    kind for row in SERVICES for kind in (row.request, row.reply)
}
KINDS = sorted(TYPES, key=lambda kind: kind.__name__)
finite = st.floats(allow_nan=False, allow_infinity=False)
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | finite | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


def values(kind: Any) -> st.SearchStrategy[Any]:
    """Every value that a field of this type may have."""
    if isinstance(kind, type) and issubclass(kind, m.Message):
        hints = typing.get_type_hints(kind, include_extras=True)
        return st.builds(kind, **{name: values(hints[name]) for name in kind.__struct_fields__})
    if typing.get_origin(kind) is typing.Annotated:
        return bounded(*typing.get_args(kind))
    if typing.get_origin(kind) is list:
        return st.lists(values(typing.get_args(kind)[0]), max_size=3)
    if typing.get_origin(kind) is dict:
        return st.dictionaries(st.text(), st.integers(0, 2**63), max_size=3)
    return {float: finite, int: st.integers(0, 999_999_999), str: st.text(), bool: st.booleans()}[
        kind
    ]


def bounded(kind: Any, meta: msgspec.Meta) -> st.SearchStrategy[Any]:
    """Numbers and lists within the field's bounds; of anything else the plain type."""
    ros = str((meta.extra or {}).get("ros", ""))
    if ros.startswith("float32"):
        single = st.floats(width=32, allow_nan=False, allow_infinity=False)
        return st.lists(single, max_size=3) if ros.endswith("[]") else single
    if ros == "uint8[]":
        return st.lists(st.integers(0, 255), max_size=3)
    if meta.min_length:
        return st.lists(finite, min_size=meta.min_length, max_size=meta.max_length)
    if kind is not int:
        return values(kind)
    least = int(meta.ge or 0)
    return st.integers(least, int(meta.le) if meta.le is not None else int(meta.lt or 1) - 1)


def refusal(payload: bytes, encoding: str = WIRES["json"], *kinds: type[m.Message]) -> str:
    with pytest.raises(CodecError) as error:
        decode(payload, encoding, kinds or (m.Twist,))
    message = str(error.value)
    assert message.isprintable()
    assert len(message) < 300
    return message


def test_every_message_survives_every_wire() -> None:
    def survive(message: m.Message) -> None:
        kind = type(message)
        for wire in WIRES:
            assert decode(encode(message, wire), WIRES[wire], (kind,)) == message, wire

    for kind in KINDS:
        settings(max_examples=4)(given(values(kind))(survive))()


def test_json_is_what_people_write_by_hand() -> None:
    assert decode(b'{"linear": {"x": 0.3}}', "application/json", (m.Twist,)) == m.Twist.planar(0.3)
    assert msgspec.json.decode(encode(m.Twist.planar(0.3)))["linear"] == {
        "x": 0.3,
        "y": 0.0,
        "z": 0.0,
    }


def test_an_encoding_may_carry_a_schema() -> None:
    for wire in WIRES:
        payload = encode(m.Twist.planar(1), wire)
        assert decode(
            payload, f"{WIRES[wire]};geometry_msgs/msg/Twist", (m.Twist,)
        ) == m.Twist.planar(1)


def test_encodings_without_meaning_are_taken_for_json() -> None:
    for encoding in ["", "zenoh/bytes", "zenoh/string", "text/plain", "text/json"]:
        assert decode(encode(m.Twist.planar(1)), encoding, (m.Twist,)) == m.Twist.planar(1)


def test_another_encoding_is_refused_with_those_known() -> None:
    for encoding in ["image/png", "application/x-cdr", "application/jsonx", "x" * 5000, "a\nb"]:
        message = refusal(b"{}", encoding)
        assert repr(encoding[:80]) in message
        assert all(name in message for name in WIRES.values())


def test_numbers_that_are_not_finite_are_not_written() -> None:
    for bad in [math.nan, math.inf, -math.inf]:
        for wire in WIRES:
            odom = m.Odometry(header=m.Header(frame_id="null"))
            encode(odom, wire)  # a text of "null" is none
            odom.twist.covariance[35] = bad
            with pytest.raises(
                CodecError, match=r"^Odometry\.twist\.covariance\[35\] is not a finite number$"
            ):
                encode(odom, wire)


def test_a_nan_in_cdr_reaches_the_reader_which_must_check_for_it() -> None:
    payload = b"\0\1\0\0" + struct.pack("<6d", math.nan, 0, 0, 0, 0, 0)
    assert (
        not_finite(decode(payload, f"{WIRES['cdr']};geometry_msgs/msg/Twist", (m.Twist,)))
        == "linear.x"
    )


def test_a_text_that_is_no_unicode_is_not_written() -> None:
    for wire in WIRES:
        with pytest.raises(CodecError, match=r"^Header: a text is not Unicode"):
            encode(m.Header(frame_id="\udcff"), wire)


def test_the_first_type_that_fits_is_taken() -> None:
    kinds = (m.Twist, m.TwistStamped)
    stamped = m.TwistStamped(twist=m.Twist.planar(1))
    for wire in WIRES:
        assert decode(encode(stamped, wire), WIRES[wire], kinds) == stamped
        assert decode(encode(stamped.twist, wire), WIRES[wire], kinds) == stamped.twist
    assert isinstance(decode(b"{}", "", kinds), m.Twist)
    assert (
        refusal(b'{"linaer": {}}', "", *kinds)
        == "not a Twist: Object contains unknown field `linaer`"
    )
    assert (
        refusal(b'{"header": {}, "twsit": {}}', "", *kinds)
        == "not a TwistStamped: Object contains unknown field `twsit`"
    )
    assert (
        refusal(b'{"header": {"x": 1}}', "", m.Twist)
        == "not a Twist: Object contains unknown field `header`"
    )


def test_a_tolerant_reader_ignores_the_fields_of_a_newer_sender() -> None:
    odom = msgspec.to_builtins(m.Odometry(child_frame_id="base"))
    odom["quality"] = {"x": 1}
    odom["pose"]["pose"]["position"]["w"] = 2.0
    status = msgspec.to_builtins(
        m.CommandStatus(refused={"late": 1}, sources=[m.CommandSource("a", rate=2)])
    )
    status["sources"][0]["battery"] = [1]
    expected: tuple[tuple[Any, m.Message], ...] = (
        (odom, m.Odometry(child_frame_id="base")),
        (
            status,
            m.CommandStatus(refused={"late": 1}, sources=[m.CommandSource("a", rate=2)]),
        ),
    )
    for value, read in expected:
        payload = msgspec.json.encode(value)
        assert decode(payload, WIRES["json"], (type(read),), tolerant=True) == read
        assert "unknown field" in refusal(payload, WIRES["json"], type(read))


def test_a_tolerant_reader_still_refuses_a_wrong_value_and_another_message() -> None:
    with pytest.raises(
        CodecError, match=r"^not a Vector3: Object contains unknown field `success`$"
    ):
        decode(b'{"success": true}', "", (m.Vector3,), tolerant=True)
    with pytest.raises(
        CodecError, match=r"^not a Vector3: Expected `float`, got `str` - at `\$\.x`$"
    ):
        decode(b'{"x": "1", "w": 2}', "", (m.Vector3,), tolerant=True)


def test_bad_json_is_refused_with_its_reason() -> None:
    for payload, reason in [
        (b"", "truncated"),
        (b"null", "got `null`"),
        (b"[]", "got `array`"),
        (b'{"linear": {"x": NaN}}', "malformed"),
        (b'{"linear": {"x": 1e999}}', "out of range"),
        (b'{"linear": {"x": ' + b"9" * 5000 + b"}}", "out of range"),
        (b'{"linear": {"x": "0.3"}}', "got `str` - at `$.linear.x`"),
        (b'{"linear": {"x": true}}', "got `bool`"),
        (b'{"linear": {"x": null}}', "got `null`"),
        (b'{"linear": {}} {}', "trailing"),
        (b"[" * 100_000, "got `array`"),
        (b'{"linear":' * 100_000, "unknown field `linear` - at `$.linear`"),
        (b"\xff\xfe{}", "malformed"),
        (b'{"a\\nb\\u001b[2J": 1}', "unknown field `a?b?[2J`"),
        (b'{"' + b"x" * 60_000 + b'": 1}', "unknown field `xxx"),
    ]:
        assert reason in refusal(payload)


def test_text_that_is_no_utf8_is_refused() -> None:
    assert "not a Header" in refusal(b'{"frame_id": "\xff\xfe"}', "", m.Header)


def test_another_encoding_is_refused_by_name() -> None:
    reason = refusal(b"\x80", "application/msgpack")
    known = "known: application/json, application/cdr"
    assert reason == f"unknown encoding 'application/msgpack'; {known}"


@pytest.mark.parametrize("wire", WIRES)
@given(data=st.data())
def test_a_message_that_was_cut_off_is_refused(wire: str, data: st.DataObject) -> None:
    payload = encode(m.Odometry(child_frame_id="base"), wire)
    refusal(payload[: data.draw(st.integers(0, len(payload) - 1))], WIRES[wire], m.Odometry)


@given(st.binary(), st.sampled_from(sorted(WIRES.values())))
def test_any_bytes_are_a_message_or_a_codec_error(payload: bytes, encoding: str) -> None:
    try:
        assert isinstance(decode(payload, encoding, (m.Twist, m.TwistStamped)), m.Message)
    except CodecError as error:
        assert str(error).isprintable()


@given(plain, st.sampled_from(KINDS))
def test_any_value_is_a_message_or_a_codec_error(value: Any, kind: type[m.Message]) -> None:
    try:
        assert isinstance(decode(msgspec.json.encode(value), WIRES["json"], (kind,)), kind)
    except CodecError as error:
        assert str(error).isprintable()
    try:
        assert isinstance(convert(value, (kind,)), kind)
    except CodecError as error:
        assert str(error).isprintable()


def test_plain_values_become_messages() -> None:
    assert convert({"linear": {"x": 1}}, (m.Twist,)) == m.Twist.planar(1)
    # from a selector's parameters
    assert convert({"request_goal": "2"}, (m.NextGoalRequest,)) == m.NextGoalRequest(2)
    # a typo on the command line, in telemetry as well
    for kind in (m.Twist, m.Odometry, m.CommandStatus):
        with pytest.raises(CodecError, match=rf"not an? {kind.__name__}: .*`linaer`"):
            convert({"linaer": {}}, (kind,))


def test_cdr_is_loaded_only_where_it_is_used() -> None:
    code = "import sys, holozen.messages.codec as c; c.encode(c.Message()); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"holozen.messages.cdr", "holozen.messages.definitions"} & set(done.stdout.split())


def test_a_single_number_that_is_not_finite_is_found_wherever_it_stands() -> None:
    for at in range(36):  # between words with and without a u
        odom = m.Odometry(child_frame_id="u" * (at % 3))
        odom.pose.covariance[at] = math.nan
        with pytest.raises(CodecError, match="not a finite number"):
            encode(odom)
    for twist in (m.Twist.planar(math.nan), m.Twist.planar(0.0, 0.0, math.inf)):
        with pytest.raises(CodecError, match="not a finite number"):
            written(twist, "json")
