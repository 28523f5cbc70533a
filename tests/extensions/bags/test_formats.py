"""How messages are stored in a bag."""

import json
from typing import Any

import msgspec
import pytest

from holozen.bags.formats import format_of, json_schema, known, types_of
from holozen.messages import Odometry, Twist, TwistStamped
from holozen.messages.codec import encode

TWISTS = (Twist, TwistStamped)


def test_a_payload_is_described_by_its_content() -> None:
    for payload, encoding, types, expected in [
        (
            encode(Twist()),
            "application/json",
            TWISTS,
            ("json", "geometry_msgs/msg/Twist", "jsonschema"),
        ),
        (
            encode(TwistStamped()),
            "application/json",
            TWISTS,
            ("json", "geometry_msgs/msg/TwistStamped", "jsonschema"),
        ),
        (
            b'{"linear": {"x": 1}}',
            "zenoh/bytes",
            TWISTS,
            ("json", "geometry_msgs/msg/Twist", "jsonschema"),
        ),
        (b'{"speed": 1}', "application/json", TWISTS, ("json", "", "")),
        (b'{"speed": 1}', "zenoh/string", (), ("json", "", "")),
        (b"[1, 2]", "application/json", (), ("json", "", "")),
        (b"hello", "text/plain", (), ("text/plain", "", "")),
        (b'{"broken', "application/json", (), ("application/json", "", "")),
        (b"\xff\x00\x01", "zenoh/bytes", (Odometry,), ("zenoh/bytes", "", "")),
        (b"\xff\x00\x01", "", (), ("zenoh/bytes", "", "")),
        (b"\xff\xd8", "image/jpeg", (), ("image/jpeg", "", "")),
        (b"\x00\x01\x00\x00", "application/cdr;geometry_msgs", (), ("cdr", "", "")),
        (b"[" * 100_000, "application/json", (), ("application/json", "", "")),
    ]:
        form, message = format_of(payload, encoding, types)
        assert (form.encoding, form.schema, form.schema_encoding) == expected
        assert form.zenoh_encoding == encoding
        assert (message is None) == (form.schema == "")


def test_a_schema_is_valid_json_with_the_name_of_ros() -> None:
    form, _ = format_of(encode(Odometry()), "application/json", (Odometry,))
    assert msgspec.json.decode(form.schema_data)["title"] == form.schema == "nav_msgs/msg/Odometry"


def test_the_table_knows_the_types_of_its_keys_and_publishers_those_of_others() -> None:
    assert types_of("Fred/cmd_vel", lambda: pytest.fail("not asked")) == TWISTS
    assert types_of("ground_truth", lambda: {"nav_msgs/msg/Odometry", "any/msg/Any"}) == (Odometry,)
    assert types_of("ground_truth", set) == ()


TYPES = {"boolean", "string", "number", "integer", "object", "array"}


def assert_plain(schema: dict[str, Any]) -> None:
    """As Foxglove's and Lichtblick's readers take it: a type everywhere, no references, items and
    properties.
    """
    assert schema["type"] in TYPES
    assert schema.keys() <= {"type", "properties", "items", "title"}
    if schema["type"] == "object":
        for field in schema["properties"].values():
            assert_plain(field)
    if schema["type"] == "array":
        assert_plain(schema["items"])


def test_a_viewer_can_read_the_schema_of_every_message() -> None:
    for name in sorted(known()):
        schema = json.loads(json_schema(name))
        assert schema["title"] == name
        assert_plain(schema)


def test_odometry_has_its_fields_to_the_last() -> None:
    schema = json.loads(json_schema("nav_msgs/msg/Odometry"))
    pose = schema["properties"]["pose"]["properties"]
    assert list(pose["pose"]["properties"]["position"]["properties"]) == ["x", "y", "z"]
    assert pose["covariance"] == {"type": "array", "items": {"type": "number"}}
    transform = json.loads(json_schema("tf2_msgs/msg/TFMessage"))["properties"]["transforms"][
        "items"
    ]
    assert transform["properties"]["header"]["properties"]["frame_id"] == {"type": "string"}
