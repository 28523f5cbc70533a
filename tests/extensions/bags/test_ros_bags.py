"""Bags in CDR, as readers that know nothing of us see them: rosbags, and the mcap library's own
reader of schemas.
"""

from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from holozen.bags.formats import as_cdr, format_of, known, msg_schema
from holozen.bags.writer import BagWriter
from holozen.messages import CommandStatus, Message, Odometry, Twist, codec

from .bags import START, read


def odometry() -> Odometry:
    odom = Odometry(child_frame_id="base")
    odom.header.frame_id, odom.header.stamp.nanosec = "odom", 7
    odom.pose.pose.position.x, odom.twist.twist.angular.z = 1.5, -0.25
    return odom


def ros_bag(path: Path, *messages: Message) -> Path:
    writer = BagWriter(str(path), profile="ros2")
    for i, message in enumerate(messages):
        writer.write(f"/{type(message).__name__.lower()}", *as_cdr(message), START + i)
    writer.close()
    return path


def test_rosbags_reads_topics_types_and_values(tmp_path: Path) -> None:
    reader = McapReader(ros_bag(tmp_path / "a.mcap", odometry(), Twist.planar(x=0.5)))
    reader.open()
    assert [(c.topic, c.msgtype) for c in reader.connections] == [
        ("/odometry", "nav_msgs/msg/Odometry"),
        ("/twist", "geometry_msgs/msg/Twist"),
    ]
    store = get_typestore(Stores.ROS2_HUMBLE)
    messages: list[Any] = [
        store.deserialize_cdr(bytes(data), connection.msgtype)
        for connection, _, data in reader.messages(reader.connections)
    ]
    odom, twist = messages
    assert (odom.header.frame_id, odom.header.stamp.nanosec, odom.child_frame_id) == (
        "odom",
        7,
        "base",
    )
    assert (odom.pose.pose.position.x, odom.twist.twist.angular.z) == (1.5, -0.25)
    assert list(odom.pose.covariance) == [0.0] * 36
    assert twist.linear.x == 0.5
    reader.close()


def test_the_schema_of_every_message_is_understood_by_rosbags() -> None:
    """Types of ROS are those of ROS; ours stands on its own."""
    for name in sorted(known()):
        types = get_types_from_msg(msg_schema(name).decode(), name)
        assert name in types
        theirs = get_typestore(Stores.ROS2_HUMBLE).fielddefs
        for one, definition in types.items():
            if one in theirs:
                assert [field for field, _ in definition[1]] == [
                    field for field, _ in theirs[one][1]
                ], one


def test_the_schema_names_each_part_once() -> None:
    text = msg_schema("nav_msgs/msg/Odometry").decode()
    assert text.startswith("std_msgs/Header header\nstring child_frame_id\n")
    assert (
        text.count("MSG: geometry_msgs/Vector3\n")
        == text.count("MSG: geometry_msgs/Quaternion\n")
        == 1
    )
    assert msg_schema("no_such/msg/Type") == b""


def test_foreign_cdr_has_a_schema_if_its_encoding_names_a_type(tmp_path: Path) -> None:
    payload = codec.encode(Twist(), "cdr")
    form, _ = format_of(payload, "application/cdr;geometry_msgs/msg/Vector3", ())
    assert (form.schema, form.schema_encoding) == ("geometry_msgs/msg/Vector3", "ros2msg")
    assert format_of(payload, "application/cdr", ())[0].schema_encoding == ""
    bridged, message = format_of(payload, "zenoh/bytes", (Twist,))
    assert (bridged.encoding, bridged.schema, message) == (
        "cdr",
        "geometry_msgs/msg/Twist",
        Twist(),
    )


def test_we_read_our_own_messages_back(tmp_path: Path) -> None:
    status = CommandStatus(obeyed="me", refused={"stale": 3})
    path = ros_bag(tmp_path / "a.mcap", status, odometry())
    found = [
        codec.decode(m.payload, m.channel.encoding, (known()[m.channel.type],)) for m in read(path)
    ]
    assert found == [status, odometry()]
    assert [m.channel.key for m in read(path)] == ["commandstatus", "odometry"]
    with path.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        assert {schema.encoding for schema in reader.get_summary().schemas.values()} == {"ros2msg"}  # type: ignore[union-attr]
