"""How a sample stands in a bag."""

import msgspec
import pytest

from holozen.bag.forms import form_of, types_of
from holozen.codec import encode
from holozen.messages import Message, Odometry, Twist, TwistStamped

TWISTS = (Twist, TwistStamped)


@pytest.mark.parametrize(
    ("payload", "encoding", "types", "told"),
    [
        (encode(Twist()), "application/json", TWISTS, ("json", "geometry_msgs/msg/Twist", "jsonschema")),
        (encode(TwistStamped()), "application/json", TWISTS, ("json", "geometry_msgs/msg/TwistStamped", "jsonschema")),
        (b'{"linear": {"x": 1}}', "zenoh/bytes", TWISTS, ("json", "geometry_msgs/msg/Twist", "jsonschema")),
        (encode(Twist(), "msgpack"), "application/msgpack", TWISTS, ("msgpack", "geometry_msgs/msg/Twist", "")),
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
    ],
)
def test_a_payload_is_told_by_what_it_is(
    payload: bytes, encoding: str, types: tuple[type[Message], ...], told: tuple[str, str, str]
) -> None:
    form, message = form_of(payload, encoding, types)
    assert (form.encoding, form.schema, form.schema_encoding) == told
    assert form.zenoh_encoding == encoding
    assert (message is None) == (form.schema == "")


def test_a_schema_is_valid_json_with_the_name_of_ros() -> None:
    form, _ = form_of(encode(Odometry()), "application/json", (Odometry,))
    assert msgspec.json.decode(form.schema_data)["title"] == form.schema == "nav_msgs/msg/Odometry"


def test_the_table_knows_the_types_of_its_keys_and_publishers_those_of_others() -> None:
    assert types_of("Fred/cmd_vel", lambda: pytest.fail("not asked")) == TWISTS
    assert types_of("ground_truth", lambda: {"nav_msgs/msg/Odometry", "any/msg/Any"}) == (Odometry,)
    assert types_of("ground_truth", set) == ()
