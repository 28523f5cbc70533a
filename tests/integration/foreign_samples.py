"""What processes that know nothing of holozen put on their keys."""

from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
Twist, Vector3 = (STORE.types[f"geometry_msgs/msg/{name}"] for name in ("Twist", "Vector3"))
CDR = bytes(
    STORE.serialize_cdr(
        Twist(Vector3(1.5, 0.0, -2.0), Vector3(0.0, 0.0, 0.25)), "geometry_msgs/msg/Twist"
    )
)

PUTS = {  # by key: payload and Zenoh Encoding
    "a/json": (b'{"speed": 1.5, "name": "x"}', "application/json"),
    "a/lines": ('{\n "name": "\u00e9\u009b"\n}'.encode(), "application/json"),
    "a/text": (b"red \x1b[31malert\x07", "text/plain"),
    "a/bytes": (bytes(range(200, 256)), "zenoh/bytes"),
    "a/cdr": (CDR, "application/cdr"),
    "a/schema": (CDR, "application/cdr;geometry_msgs/msg/Twist"),
    "a/plain": (CDR, "zenoh/bytes"),
    "a/cut": (CDR[:20], "application/cdr;geometry_msgs/msg/Twist"),
    "a/stamped": (b'{"header": {"stamp": {"sec": 7, "nanosec": 0}}}', "application/json"),
}

PAYLOADS = {  # by Zenoh Encoding
    "application/json": b'{"a":   1.0, "b": [1,2]}',
    "text/plain": "grüße\n".encode(),
    "zenoh/bytes": bytes(range(256)),
    "application/cdr": b"\x00\x01\x00\x00" + bytes(48),
    "image/jpeg": b"\xff\xd8\xff",
    "application/protobuf;of.some.Type": b"\x08\x01",
}
