"""What a script sends with a NaN or an infinity goes out as CDR, which has them; all else as
ever.
"""

import math
from collections.abc import Callable
from typing import Any

import pytest

from holozen import messages as m
from holozen.messages.codec import WIRES, CodecError, decode, encode, encoding, written
from holozen.messages.definitions import Field, Interface
from holozen.ros import rclpy
from holozen.ros.generated import find, make
from holozen.ros.rclpy import context
from holozen.ros.rclpy.qos import DurabilityPolicy, QoSProfile
from holozen.testing import Wire, wait_for

Scan: Any = find("sensor_msgs/msg/LaserScan")
Battery: Any = find("sensor_msgs/msg/BatteryState")
GetPlan: Any = find("nav_msgs/srv/GetPlan")
CDR = "application/cdr;sensor_msgs/msg/LaserScan"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
Spin = Callable[..., Any]


@pytest.fixture
def used(ros: Wire, monkeypatch: pytest.MonkeyPatch) -> str:
    """The wire of the nodes: JSON, which has no infinity."""
    monkeypatch.setattr(context, "connection", ros.connection._replace(wire="json"))
    return "json"


def test_a_scan_with_an_infinite_range_is_published_and_read(ros: Wire, used: str) -> None:
    node, reader, got = rclpy.create_node("tom"), rclpy.create_node("reader"), list[Any]()
    reader.create_subscription(Scan, "scan", got.append, 10)
    publisher, bus = node.create_publisher(Scan, "scan", 10), ros.bus()
    tap = bus.subscribe_raw("scan")

    def reaches_both() -> bool:
        publisher.publish(Scan())
        rclpy.spin_once(reader, timeout_sec=0)
        return bool(got) and tap.try_recv() is not None

    wait_for(reaches_both)
    wait_for(bus.served("scan"))
    for ranges, named in (
        ([1.0], encoding(used, Scan)),
        ([1.0, math.inf, math.nan], CDR),
        ([2.0], encoding(used, Scan)),
    ):

        def arrived(
            ranges: list[float] = ranges, named: str = named
        ) -> bool:  # a full link may drop one
            publisher.publish(Scan(ranges=ranges))
            (reply,) = bus.session.get("scan", timeout=10)
            assert reply.ok and str(reply.ok.encoding) == named
            rclpy.spin_once(reader, timeout_sec=0.1)
            samples = [
                sample
                for sample in iter(tap.try_recv, None)
                if sample.payload == bytes(reply.ok.payload)
            ]
            assert {sample.encoding for sample in samples} <= {named}
            return bool(samples) and repr(got[-1].ranges.tolist()) == repr(ranges)

        wait_for(arrived)
    found = dict.fromkeys(repr(each.ranges.tolist()) for each in got if len(each.ranges))
    assert list(found) == ["[1.0]", "[1.0, inf, nan]", "[2.0]"]


def test_a_late_subscriber_gets_it_too(used: str, ros: Wire, spin_for: Spin) -> None:
    node, got = rclpy.create_node("tom"), list[Any]()
    rclpy.create_node("base").create_publisher(Battery, "battery", LATCHED).publish(
        Battery(current=math.nan)
    )
    node.create_subscription(Battery, "battery", got.append, LATCHED)
    spin_for(lambda: got, node)
    assert math.isnan(got[0].current)


def test_requests_and_responses_carry_any_number(used: str, ros: Wire, spin_for: Spin) -> None:
    node, asked = rclpy.create_node("tom"), list[float]()

    def plan(request: Any, response: Any) -> Any:
        asked.append(request.tolerance)
        response.plan.poses = [find("geometry_msgs/msg/PoseStamped")()]
        response.plan.poses[0].pose.position.x = -math.inf
        return response

    node.create_service(GetPlan, "plan", plan)
    future = (
        rclpy.create_node("asker")
        .create_client(GetPlan, "plan")
        .call_async(GetPlan.Request(tolerance=math.inf))
    )
    spin_for(future.done, node)
    assert (asked, future.result().plan.poses[0].pose.position.x) == ([math.inf], -math.inf)


def test_only_what_was_made_for_scripts_takes_any_number() -> None:
    for wire in WIRES:
        ours, theirs = m.Twist.planar(math.nan), find("geometry_msgs/msg/Twist")()
        theirs.linear.x = math.nan
        payload, name = written(theirs, wire)
        assert name == "cdr"
        assert math.isnan(decode(payload, encoding(name, type(theirs)), (m.Twist,)).linear.x)
        for write in (written, encode):
            with pytest.raises(CodecError, match=r"^Twist\.linear\.x is not a finite number$"):
                write(ours, wire)
        theirs.linear.x = 1.0
        assert written(theirs, wire) == (encode(m.Twist.planar(1.0), wire), wire)


def test_a_request_of_our_own_is_refused(wire: Wire) -> None:
    bus = wire.bus()
    with pytest.raises(CodecError, match=r"^NextGoalReply\.x_goal is not a finite number$"):
        bus.call("next_goal", m.NextGoalReply(math.nan), m.NextGoalReply)


def test_what_cdr_cannot_hold_is_reported() -> None:
    kind: Any = make(
        Interface(
            "t/msg/Wide", "msg", (Field("x", "float32", "sequence"), Field("text", "wstring"))
        )
    )
    assert written(kind(x=[1.0]), "json")[1] == "json"
    with pytest.raises(CodecError) as error:
        written(kind(x=[1.0, math.nan]), "json")
    message = "Wide.x[1] is not a finite number, which needs CDR, and that cannot hold the rest: "
    assert str(error.value).startswith(message)
    assert "wstring" in str(error.value)
    for finite in (kind(x=[1.0], text="null"), kind(x=[1.0])):
        assert written(finite, "json") == (encode(finite, "json"), "json")


def test_a_text_that_reads_like_no_number_changes_nothing() -> None:
    scan = Scan(ranges=[1.0])
    scan.header.frame_id = "null"
    assert written(scan, "json") == (encode(scan), "json")
