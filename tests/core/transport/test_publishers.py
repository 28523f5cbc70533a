"""A publisher writes messages, and answers a get with the last one."""

import itertools
import json
import math
import os
import signal
import sys
import threading
from typing import Any

import pytest
import zenoh

from holozen.bus import Bus
from holozen.messages import Odometry, Twist, Vector3, codec
from holozen.messages.codec import WIRES, CodecError, encoding
from holozen.testing import Process, Wire, wait_for
from holozen.transport.connection import Connection
from holozen.transport.pubsub import Publisher


def last(bus: Bus, key: str) -> list[tuple[bytes, str]]:
    replies = bus.session.get(key, timeout=10)
    return [(bytes(reply.ok.payload), str(reply.ok.encoding)) for reply in replies if reply.ok]


@pytest.mark.parametrize("name", WIRES)
def test_what_is_put_arrives_with_encoding_priority_and_source(wire: Wire, name: str) -> None:
    writer, reader = wire.bus("writer", wire=name), wire.bus("reader")
    subscription = reader.subscribe("cmd_vel", Twist)
    publisher: Publisher[Twist] = writer.publisher("cmd_vel", Twist, "DATA_LOW")
    wait_for(lambda: publisher.matched)
    publisher.put(Twist.planar(0.5))
    received = subscription.recv()
    assert received.message == Twist.planar(0.5)
    assert (received.key, received.encoding) == ("cmd_vel", encoding(name, Twist))
    assert (received.priority, received.source) == ("DATA_LOW", writer.source)
    assert writer.source.startswith("writer@")


def test_a_message_of_another_type_is_refused_and_both_are_named(wire: Wire) -> None:
    publisher: Publisher[Any] = wire.bus("writer").publisher("cmd_vel", Twist)
    for put, given in itertools.product(
        (publisher.put, publisher.queue), (Odometry(), {"linear": {"x": 0.1}})
    ):
        with pytest.raises(
            TypeError,
            match=rf"^cmd_vel: an? {type(given).__name__}, but this publisher sends Twist$",
        ):
            put(given)


def test_nothing_matches_until_there_is_a_subscriber(wire: Wire) -> None:
    publisher: Publisher[Twist] = wire.bus("writer").publisher("cmd_vel", Twist)
    assert not publisher.matched
    reader = wire.bus("reader").subscribe("cmd_vel", Twist)
    wait_for(lambda: publisher.matched)
    reader.close()
    wait_for(lambda: not publisher.matched)


def test_a_get_is_answered_with_the_last_message(
    wire: Wire, capfd: pytest.CaptureFixture[str]
) -> None:
    writer, reader = wire.bus("writer"), wire.bus("reader")
    capfd.readouterr()  # a busy machine may have made one wait for an answer
    publisher: Publisher[Odometry] = writer.publisher("odom", Odometry)
    assert last(writer, "odom") == []
    publisher.put(Odometry(child_frame_id="first"))
    publisher.put(Odometry(child_frame_id="second"))
    ((payload, encoding),) = wait_for(lambda: last(reader, "odom"))
    assert b'"second"' in payload
    assert encoding == "application/json"
    assert capfd.readouterr().err == ""  # Zenoh's own thread would report errors there


def test_a_get_that_cannot_be_answered_is_reported_and_the_next_one_is(
    wire: Wire, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    writer, reader = wire.bus("writer"), wire.bus("reader")
    publisher = writer.publisher("cmd_vel", Twist)
    publisher.put(Twist())
    wait_for(reader.served("cmd_vel"))
    capsys.readouterr()  # a busy machine may have made one wait for an answer
    with monkeypatch.context() as broken:
        broken.setattr(Publisher, "reply", lambda *_: 1 // 0)
        assert last(reader, "cmd_vel") == []
    assert (
        capsys.readouterr().err
        == "cmd_vel: ZeroDivisionError: integer division or modulo by zero\n"
    )
    assert len(last(reader, "cmd_vel")) == 1


def test_a_number_that_is_not_finite_is_neither_sent_nor_remembered(wire: Wire) -> None:
    bus = wire.bus()
    subscription = bus.subscribe("cmd_vel", Twist)
    publisher: Publisher[Twist] = bus.publisher("cmd_vel", Twist)
    publisher.put(Twist.planar(1))
    with pytest.raises(CodecError, match=r"^Twist\.linear\.y is not a finite number$"):
        publisher.put(Twist(Vector3(y=math.nan)))
    publisher.put(Twist.planar(2))
    assert [subscription.recv().message for _ in range(2)] == [Twist.planar(1), Twist.planar(2)]
    with pytest.raises(CodecError):
        publisher.put(Twist(Vector3(y=math.inf)))
    assert b'"x":2' in last(bus, "cmd_vel")[0][0]


@pytest.mark.parametrize("name", WIRES)
def test_a_command_with_a_value_of_a_wrong_type_is_not_sent(wire: Wire, name: str) -> None:
    bus = wire.bus(wire=name)
    publisher: Publisher[Twist] = bus.publisher("cmd_vel", Twist)
    publisher.put(Twist.planar(1))
    wrong: Any = "fast"
    for put in (publisher.put, publisher.queue):
        with pytest.raises(CodecError, match=r"linear\.x"):
            put(Twist.planar(wrong))
    bus.send_queued()
    assert last(bus, "cmd_vel") == [(codec.encode(Twist.planar(1), name), encoding(name, Twist))]


def test_a_closed_publisher_leaves_nothing_of_its_key(wire: Wire) -> None:
    writer, reader = wire.bus("writer"), wire.bus("reader")
    graph = reader.graph()
    publisher: Publisher[Twist] = writer.publisher("cmd_vel", Twist)
    publisher.put(Twist())
    wait_for(graph.endpoints)
    publisher.close()
    wait_for(lambda: [one.kind for one in graph.endpoints()] == ["node"])
    assert last(writer, "cmd_vel") == []


def test_samples_are_numbered_by_their_session_on_each_key(wire: Wire) -> None:
    bus, other, reader = wire.bus("one"), wire.bus("other"), wire.bus("reader")
    tap = reader.subscribe_raw("*")
    first: Publisher[Twist] = bus.publisher("cmd_vel", Twist)
    second: Publisher[Twist] = bus.publisher("cmd_vel", Twist)
    third: Publisher[Twist] = bus.publisher("joy_vel", Twist)
    wait_for(lambda: all(publisher.matched for publisher in (first, second, third)))
    for publisher in (first, first, second, third, first):
        publisher.put(Twist())
    bus.session.put("plain", b"{}")
    bus.session.put("forged", b"{}", attachment=b"one@aa;-1;5")
    numbers = [tap.recv().number for _ in range(7)]
    sender = f"one@{bus.id}"
    assert numbers == [(sender, 0), (sender, 1), (sender, 2), (sender, 0), (sender, 3), None, None]
    publisher = other.publisher("cmd_vel", Twist)
    wait_for(lambda: publisher.matched)
    publisher.put(Twist())
    assert tap.recv().number == (f"other@{other.id}", 0)


HOLDER = """
import ctypes, signal, sys
from holozen.bus import Bus
from holozen.messages import Odometry, Twist
from holozen.transport.connection import Connection
with Bus("holder", Connection(connect=(sys.argv[1],), listen=(sys.argv[1],))) as bus:
    odom, commands = bus.publisher("odom", Odometry), bus.subscribe_raw("cmd_vel", 10)
    print("ready", flush=True)
    ctypes.PyDLL(None).read(0, ctypes.create_string_buffer(1), 1)  # no other thread of Python runs during it
    print("awake", flush=True)
    signal.pause()
"""  # noqa: E501


# us; then Zenoh opens another link
PATIENCE = "transport/link/tx/queue/congestion_control/block/wait_before_close"


def test_many_gets_of_the_last_value_do_not_hold_up_the_link(wire: Wire) -> None:
    reading, writing = os.pipe()
    with (
        os.fdopen(reading, "rb") as end,
        os.fdopen(writing, "wb"),
        Process([sys.executable, "-c", HOLDER, wire.endpoint], stdin=end) as holder,
    ):
        holder.wait_for_line("ready")
        asking = Bus(
            "asking",
            Connection(mode="client", connect=(wire.endpoint,), cfg=((PATIENCE, "200000000"),)),
        )
        with asking:
            wait_for(asking.served("odom"))
            commands = asking.session.declare_publisher(
                "cmd_vel", congestion_control=zenoh.CongestionControl.BLOCK
            )
            kept = [asking.ask("odom", 20.0) for _ in range(1000)]
            # More than buffers on the way take.
            sending = threading.Thread(
                target=lambda: [commands.put(bytes(200_000)) for _ in range(200)], daemon=True
            )
            sending.start()
            wait_for(lambda: not sending.is_alive())
            assert "awake" not in holder.out
            assert len(kept) == 1000


COUNTING = """
import json, sys, zenoh
from holozen.bus import Bus
from holozen.messages import Twist
from holozen.transport.connection import Connection
connection = Connection(connect=tuple(json.loads(sys.argv[1])), listen=(), cfg=(("transport/link/tx/lease", "60000"),))
with Bus("reader", connection) as bus:
    bulk = bus.session.declare_subscriber("bulk", zenoh.handlers.RingChannel(1))
    commands = bus.subscribe("cmd_vel", Twist, depth=100)
    print("ready", flush=True)
    while (speed := commands.recv().message.linear.x) < 99:
        print("speed", speed, flush=True)
"""  # noqa: E501


def test_a_burst_of_commands_passes_a_link_that_is_held_up(wire: Wire) -> None:
    """Zenoh drops what its queue cannot hold; its own default holds two."""
    writer = wire.bus("writer")
    commands: Publisher[Twist] = writer.publisher("cmd_vel", Twist, "INTERACTIVE_HIGH")
    bulk = writer.session.declare_publisher("bulk")
    with Process([sys.executable, "-c", COUNTING, json.dumps([wire.endpoint])]) as reader:
        reader.wait_for_line("ready")
        wait_for(lambda: commands.matched and bulk.matching_status.matching)
        reader.signal(signal.SIGSTOP)
        for _ in range(400):  # more than the system's buffers hold, so the sending thread waits
            bulk.put(bytes(60_000))
        for number in range(10):
            commands.put(Twist.planar(float(number)))
        reader.signal(signal.SIGCONT)
        reader.wait_for_line("speed 9.0")
        assert reader.out.split("\n")[1:-1] == [f"speed {float(number)}" for number in range(10)]
