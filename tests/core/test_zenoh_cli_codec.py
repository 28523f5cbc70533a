"""The decoder for zenoh-cli makes one printable line of anything."""

import json
from importlib.metadata import entry_points
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from holozen import messages, wire
from holozen.messages import codec
from holozen.zenoh_cli_codec import decode


def test_zenoh_cli_finds_it() -> None:
    (found,) = entry_points(group="zenoh_cli.codecs.decoders", name="holozen")
    assert found.load() is decode


def test_every_message_of_the_wire_reads_alike_in_every_form() -> None:
    for row in wire.TOPICS:
        message = row.types[0]()
        shown = {decode(f"Fred/{row.key}", codec.encode(message, form)) for form in codec.WIRES}
        assert len(shown) == 1
        assert "bytes" not in shown.pop()


def test_a_payload_is_one_line() -> None:
    for key, payload, line in [
        (
            "cmd_vel",
            codec.encode(messages.Twist.planar(x=0.1234567)),
            "linear=(0.123457, 0, 0) angular=(0, 0, 0)",
        ),
        ("any", b'{"a": {"b": [1.0, 2.5]}, "c": ""}', 'a.b=[1, 2.5] c=""'),
        ("any", b'[{"name": "x"}, {"name": "y"}]', "[0].name=x [1].name=y"),
        (
            "any",
            json.dumps({"a": [0.0] * 36}).encode(),
            f"a=[36 values: {', '.join('0' * 12)}, ...]",
        ),
        ("any", b"42", "42"),
        ("any", b"hello\x1b[2J\nthere", "hello?[2J?there"),
        ("any", b"{}", "{}"),
        ("any", b"", '""'),
        ("any", b"\xff\xfe", "2 bytes: ff fe"),
        ("any", b"\x00\x01\x00\x00" + bytes(60), f"64 bytes: 00 01 {'00 ' * 30}..."),
        ("odom", b"\x00\x01\x00\x00\x05", "5 bytes: 00 01 00 00 05"),
        ("any", b"[" * 100_000, f"100000 bytes: {'5b ' * 32}..."),
    ]:
        assert decode(key, payload) == line


@given(st.sampled_from(["odom", "cmd_vel", "any", "next_goal"]), st.binary(max_size=200))
def test_no_payload_makes_it_fail(key: str, payload: bytes) -> None:
    assert decode(key, payload).isprintable()


VALUES: Any = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(VALUES)
def test_no_json_makes_it_fail(value: Any) -> None:
    assert decode("any", json.dumps(value).encode()).isprintable()
