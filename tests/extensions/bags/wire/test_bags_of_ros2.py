"""Bags to and from ROS 2, with rosbags (which shares no code with us) as the other side."""

import json
import random
import signal
import sqlite3
from pathlib import Path
from typing import Any, Literal

import pytest
import yaml
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from holozen.bags import BagError
from holozen.bags.reader import Bag
from holozen.cli import main
from holozen.messages import Odometry, Twist, codec
from holozen.testing import Wire, wait_for
from tests.extensions.bags.bags import played

STORE = get_typestore(Stores.ROS2_JAZZY)
SECOND = 10**9  # ns
START = 1_700_000_000 * SECOND


def a_record(wire: Wire, folder: Path, *words: str) -> dict[str, Any]:
    """Record odometry, a static transform, a text, and what ROS 2 cannot hold, until each is
    there.
    """
    recorder = wire.start("record", "-a", "--ros2", "--json", "-o", str(folder), *words)
    recorder.wait_for_line("recording every key")
    bus = wire.bus("writer")
    odom = bus.publisher("Fred/odom", Odometry)
    chatter = wire.start(
        "topic", "pub", "/chatter", "std_msgs/msg/String", "{data: grüße}", "-r", "20"
    )
    static = wire.start(
        "topic", "pub", "/tf_static", "tf2_msgs/msg/TFMessage", "{transforms: [{}]}", "-r", "20"
    )
    message = Odometry(child_frame_id="base")
    message.pose.pose.position.x, message.twist.twist.angular.z = 1.5, -0.25

    def complete() -> bool:
        bus.session.put("a-b/odom", codec.encode(message))
        bus.session.put("note", "hello")
        odom.put(message)
        with Bag(folder) as bag:
            return {m.channel.key for m in bag.messages()} >= {"Fred/odom", "chatter", "tf_static"}

    wait_for(complete)
    for process in (chatter, static, recorder):
        process.signal(signal.SIGINT)
    assert recorder.wait() == 0, recorder.err
    assert "left out" in recorder.err
    figures: dict[str, Any] = json.loads(recorder.out.splitlines()[-1])
    return figures | {"err": recorder.err}


def test_rosbags_reads_what_we_record(wire: Wire, tmp_path: Path) -> None:
    folder = tmp_path / "square"
    figures = a_record(wire, folder)
    assert figures["left_out"] > 1
    assert "messages of note: the type is not known" in figures["err"]
    assert "messages of a-b/odom: a topic of ROS 2 has letters" in figures["err"]
    assert sorted(path.name for path in folder.iterdir()) == ["metadata.yaml", "square_0.mcap"]
    with Reader(folder) as reader:
        found = {connection.topic: connection for connection in reader.connections}
        kinds = {topic: connection.msgtype for topic, connection in found.items()}
        assert kinds.items() >= {
            ("/Fred/odom", "nav_msgs/msg/Odometry"),
            ("/chatter", "std_msgs/msg/String"),
            ("/tf_static", "tf2_msgs/msg/TFMessage"),
        }
        assert not any(topic in found for topic in ("/note", "/a-b/odom"))
        assert reader.message_count == figures["messages"]
        (latched,) = found["/tf_static"].ext.offered_qos_profiles  # type: ignore[union-attr]
        assert latched.durability == QosDurability.TRANSIENT_LOCAL
        assert found["/chatter"].ext.offered_qos_profiles == []  # type: ignore[union-attr]
        for connection in reader.connections:
            assert connection.msgtype in get_types_from_msg(
                connection.msgdef.data, connection.msgtype
            )
        values: dict[str, Any] = {
            connection.topic: STORE.deserialize_cdr(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.msgtype in STORE.fielddefs
        }
    assert values["/chatter"].data == "grüße"
    odom = values["/Fred/odom"]
    assert (odom.child_frame_id, odom.pose.pose.position.x, odom.twist.twist.angular.z) == (
        "base",
        1.5,
        -0.25,
    )


def test_the_metadata_counts_what_is_in_each_file(wire: Wire, tmp_path: Path) -> None:
    folder = tmp_path / "long"
    recorder = wire.start("record", "odom", "--ros2", "--max-size", "0.1", "-o", str(folder))
    recorder.wait_for_line("recording odom")
    odom = wire.bus("writer").publisher("odom", Odometry, block=True)

    def split() -> bool:
        for _ in range(10):
            odom.put(Odometry(child_frame_id=random.randbytes(2000).hex()))
        return (folder / "long_1.mcap").exists()

    wait_for(split)
    assert recorder.interrupt() == 0, recorder.err
    info = yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert [one["path"] for one in info["files"]] == info["relative_file_paths"]
    assert sum(one["message_count"] for one in info["files"]) == info["message_count"]
    with AnyReader([folder]) as reader:
        assert sum(1 for _ in reader.messages()) == info["message_count"]
    with Bag(folder) as bag:
        assert sum(1 for _ in bag.messages()) == info["message_count"]


def theirs(
    folder: Path, plugin: StoragePlugin, version: Literal[8, 9], mode: CompressionMode
) -> Path:
    """A bag as rosbags writes it: odometry at 10 Hz, one command, and a type that only it
    defines.
    """
    text = "uint8 size\nstring<=9 word"
    STORE.register(
        {
            k: v
            for k, v in get_types_from_msg(text, "shop_msgs/msg/Cup").items()
            if k not in STORE.fielddefs
        }
    )
    t: Any = STORE.types
    writer = Writer(folder, version=version, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=STORE)
        command = writer.add_connection("/cmd_vel", "geometry_msgs/msg/Twist", typestore=STORE)
        cup = writer.add_connection("/cup", "shop_msgs/msg/Cup", typestore=STORE)
        for i in range(20):
            payload = codec.encode(Odometry(child_frame_id=f"base{i}"), "cdr")
            writer.write(odom, START + i * SECOND // 100, payload)
        writer.write(command, START, codec.encode(Twist.planar(x=0.5), "cdr"))
        one = t["shop_msgs/msg/Cup"](size=3, word="tea")
        writer.write(cup, START, STORE.serialize_cdr(one, "shop_msgs/msg/Cup"))
    return folder


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_we_play_what_rosbags_wrote(
    wire: Wire, tmp_path: Path, capsys: pytest.CaptureFixture[str], plugin: StoragePlugin
) -> None:
    folder = theirs(tmp_path / "theirs", plugin, 9, CompressionMode.NONE)
    assert main(["bag", "info", str(folder), "--json"]) == 0
    topics = {topic["key"]: topic for topic in json.loads(capsys.readouterr().out)["topics"]}
    assert {key: (topic["type"], topic["messages"]) for key, topic in topics.items()} == {
        "odom": ("nav_msgs/msg/Odometry", 20),
        "cmd_vel": ("geometry_msgs/msg/Twist", 1),
        "cup": ("shop_msgs/msg/Cup", 1),
    }
    odometry = wire.bus().subscribe("odom", Odometry, depth=100)
    commands = wire.bus().subscribe_raw("cmd_vel")
    done = wire.run("replay", str(folder))
    assert (done.returncode, played(done.stderr)) == (
        0,
        ["cmd_vel is left out: it moves robots; --commands plays it too"],
    )
    found: list[str] = []

    def all_there() -> bool:
        found.extend(received.message.child_frame_id for received in iter(odometry.try_recv, None))  # type: ignore[union-attr]
        return len(found) == 20

    wait_for(all_there)
    assert found == [f"base{i}" for i in range(20)]
    assert commands.try_recv() is None


def test_compressed_bags_are_refused_with_what_unpacks_them(tmp_path: Path) -> None:
    for mode, why in (
        (CompressionMode.FILE, "zstd -d"),
        (CompressionMode.MESSAGE, "ros2 bag convert"),
    ):
        with (
            pytest.raises(BagError, match=why),
            Bag(theirs(tmp_path / why, StoragePlugin.SQLITE3, 8, mode)) as bag,
        ):
            list(bag.messages())


WRONG = {
    "not a database": ("", "is not a bag of ROS 2, or damaged"),
    "no table": ("CREATE TABLE topics(id)", "no table 'messages'"),
    "a view": (
        "CREATE TABLE topics(id, name, type, serialization_format);"
        "CREATE VIEW messages AS WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x+1 FROM n) "
        "SELECT x FROM n",
        "no table 'messages'",
    ),
    "no column": ("CREATE TABLE topics(id); CREATE TABLE messages(id)", "no such column"),
    "a number for a name": (
        "CREATE TABLE topics(id, name, type, serialization_format); CREATE TABLE "
        "messages(topic_id, timestamp, data);"
        "INSERT INTO topics VALUES(1, 2, 'a/msg/B', 'cdr')",
        "a topic without a name",
    ),
    "a text for a time": (
        "CREATE TABLE topics(id, name, type, serialization_format); CREATE TABLE "
        "messages(topic_id, timestamp, data);"
        "INSERT INTO topics VALUES(1, '/a', 'a/msg/B', 'cdr'); INSERT INTO messages VALUES(1, "
        "'now', x'00')",
        "a message without a topic, a time or its bytes",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_database_is_one_line(tmp_path: Path, wrong: str) -> None:
    script, why = WRONG[wrong]
    path = tmp_path / "a.db3"
    if script:
        with sqlite3.connect(path) as database:
            database.executescript(script)
        database.close()
    else:
        path.write_bytes(b"hello" * 1000)
    with pytest.raises(BagError) as caught, Bag(path) as bag:
        list(bag.messages())
    assert why in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_database_cut_off_is_one_line(tmp_path: Path) -> None:
    (path,) = theirs(tmp_path / "theirs", StoragePlugin.SQLITE3, 8, CompressionMode.NONE).glob(
        "*.db3"
    )
    whole = path.read_bytes()
    for length in range(0, len(whole), 4096):
        path.write_bytes(whole[:length])
        with pytest.raises(BagError), Bag(path) as bag:
            list(bag.messages())
