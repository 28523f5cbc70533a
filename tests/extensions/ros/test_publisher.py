"""A publisher sends what is a message of its type, until it is destroyed or rclpy has ended."""

from typing import Any

import pytest

from holozen.command.feedback import HELD, ONLY_TURNS
from holozen.messages import CommandSource, CommandStatus
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy import context, qos
from holozen.ros.rclpy.context import ExternalShutdownException
from holozen.ros.rclpy.exceptions import InvalidHandle, RCLError
from holozen.ros.rclpy.qos import QoSProfile
from holozen.testing import Wire, wait_for

Twist: Any = find("geometry_msgs/msg/Twist")
Wrench: Any = find("geometry_msgs/msg/Wrench")


@pytest.mark.parametrize("keep", [qos.HistoryPolicy.KEEP_LAST, qos.HistoryPolicy.KEEP_ALL])
def test_what_it_sends_has_priority_data_and_waits_only_to_keep_all(
    ros: Wire, keep: qos.HistoryPolicy
) -> None:
    profile = QoSProfile(history=keep, depth=3)
    publisher = rclpy.create_node("tom").create_publisher(Twist, "cmd_vel", profile)
    tap = ros.bus().subscribe_raw("cmd_vel")
    wait_for(publisher.get_subscription_count)
    publisher.publish(Twist())
    publisher.publish(b"{}")
    whole, raw = tap.recv(), tap.recv()
    assert raw.payload == b"{}"
    is_all = keep == qos.HistoryPolicy.KEEP_ALL
    assert (whole.priority, whole.delivery) == ("DATA", ("BLOCK" if is_all else "DROP", True))
    assert (publisher.topic_name, publisher.qos_profile, publisher.logger_name) == (
        "/cmd_vel",
        profile,
        "tom",
    )
    assert publisher.wait_for_all_acked()


def test_another_type_is_reported(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    with pytest.raises(
        AttributeError,
        match=r"^geometry_msgs\.msg\.Twist\(.{,80} is not a message type; write Twist, wit",
    ):
        node.create_publisher(Twist(), "cmd_vel", 1)
    publisher = node.create_publisher(Twist, "cmd_vel", 1)
    for wrong, message in (
        (3, "an int"),
        (Twist, "a Twist; write Twist()"),
        (find("std_msgs/msg/String")(), "a String"),
    ):
        with pytest.raises(TypeError) as error:
            publisher.publish(wrong)
        assert str(error.value) == f"/cmd_vel: expected a Twist, and got {message}"


def test_a_destroyed_one_sends_nothing(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    publisher = node.create_publisher(Twist, "cmd_vel", 1)
    assert node.destroy_publisher(publisher)
    assert (publisher.get_subscription_count(), node.count_publishers("cmd_vel")) == (0, 0)
    with pytest.raises(InvalidHandle, match="the publisher of /cmd_vel was destroyed"):
        publisher.publish(Twist())
    other = node.create_publisher(Twist, "cmd_vel", 1)
    node.destroy_node()
    with pytest.raises(InvalidHandle):
        other.publish(Twist())


def test_nothing_is_sent_after_rclpy_has_ended(ros: Wire) -> None:
    publisher = rclpy.create_node("tom").create_publisher(Twist, "cmd_vel", 1)
    rclpy.shutdown()
    with pytest.raises(RCLError, match="failed to publish: rclpy was shut down"):
        publisher.publish(Twist())


def test_after_a_signal_there_is_time_for_a_stop_and_no_more(
    ros: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    publisher = rclpy.create_node("tom").create_publisher(Twist, "cmd_vel", 1)
    tap = ros.bus().subscribe_raw("cmd_vel")
    wait_for(publisher.get_subscription_count)
    monkeypatch.setattr(context, "GRACE", 1000.0)
    rclpy.get_default_context().interrupt()
    assert not rclpy.ok()
    publisher.publish(Twist())
    assert tap.recv().priority == "DATA"
    monkeypatch.setattr(context, "GRACE", 0.0)
    with pytest.raises(ExternalShutdownException):
        publisher.publish(Twist())


def test_a_robot_that_does_not_obey_is_logged_with_the_reason_once(
    ros: Wire, capfd: pytest.CaptureFixture[str]
) -> None:
    sim = ros.bus("sim")
    statuses = sim.publisher("cmd_vel_status", CommandStatus)
    node = rclpy.create_node("tom")
    publisher = node.create_publisher(Twist, "cmd_vel", 1)
    me = node._holozen.bus.source
    sideways = Twist()
    sideways.linear.y = 0.1
    logged = list[str]()

    def reports(status: CommandStatus, command: Any) -> str:
        """What is logged once that status has come, while the script publishes on."""
        before = len(logged)

        def is_logged() -> bool:
            statuses.put(status)
            publisher.publish(command)
            logged.extend(capfd.readouterr().err.splitlines())
            return len(logged) > before

        wait_for(is_logged)
        return logged[-1].partition("[tom]: ")[2]

    assert (
        reports(CommandStatus("ann@1", sources=[CommandSource(me)]), Twist())
        == "/cmd_vel: not obeyed: ann@1 drives; it has to stop first"
    )
    assert reports(CommandStatus(me), Twist()) == "/cmd_vel: obeyed again"
    held = reports(CommandStatus(sources=[CommandSource(me, held=True)]), Twist())
    assert (
        held == f"/cmd_vel: not obeyed: {HELD}; `holozen controller --resume` lets it drive again"
    )
    assert reports(CommandStatus(me, strafes=False), Twist()) == "/cmd_vel: obeyed again"
    assert reports(CommandStatus(me, strafes=False), sideways) == f"/cmd_vel: {ONLY_TURNS}"
    assert len(logged) == 5
    node.destroy_publisher(publisher)
    publisher, second = (
        node.create_publisher(Wrench, f"{wheel}_wheel_force", 1) for wheel in ("left", "rear")
    )
    overruled = CommandStatus("ann@1", refused={"overruled": 1}, sources=[CommandSource(me)])
    refused = reports(overruled, Wrench())
    assert refused == "/left_wheel_force: not obeyed: ann@1 drives; it has to stop first"
    second.publish(Wrench())
    assert not capfd.readouterr().err, "the first of a robot's forces reports for all of them"
    assert not [end for end in sim.endpoints() if end.kind == "sub" and end.key == "cmd_vel_status"]
