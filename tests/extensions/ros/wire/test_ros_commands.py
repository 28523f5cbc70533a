"""What a script sends to the sim."""

import math
from typing import Any

import pytest

from holozen.messages import CommandStatus
from holozen.messages.codec import WIRES
from holozen.ros.generated import find
from holozen.ros.rclpy import context as contexts
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.node import Node
from holozen.testing import Wire, wait_for
from tests.integration.conftest import start_sim
from tests.integration.robots import Robot, moves, rests

Twist: Any = find("geometry_msgs/msg/Twist")
Vector3: Any = find("geometry_msgs/msg/Vector3")


def _refused(status: CommandStatus) -> int:
    return status.refused.get("not finite", 0)


def test_a_command_that_is_not_finite_moves_nothing_and_is_counted(
    wire: Wire, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    start_sim(wire)
    robot = Robot(wire.bus("watcher"))
    for name, bad in zip(WIRES, (math.nan, -math.inf), strict=True):
        before = robot.status_when(lambda status: not status.obeyed)
        monkeypatch.setattr(contexts, "connection", wire.connection._replace(wire=name))
        node = Node(f"tom_{name}", context=context)
        publisher = node.create_publisher(Twist, "cmd_vel", 10)
        wait_for(publisher.get_subscription_count)

        def is_counted(
            publisher: Any = publisher, before: CommandStatus = before, bad: float = bad
        ) -> bool:
            publisher.publish(Twist(linear=Vector3(x=bad)))
            return _refused(robot.last_status()) > _refused(before)

        wait_for(is_counted)
        status = robot.status()
        assert status.last_refusal.startswith(f"tom_{name}@")
        assert status.last_refusal.endswith("linear.x is not a finite number")
        assert status.accepted == before.accepted
        assert rests(robot.odom.next())
        odom = robot.odom.from_now()

        def drives(publisher: Any = publisher, odom: Any = odom) -> bool:
            publisher.publish(Twist(linear=Vector3(x=0.2)))
            return any(moves(each, 0.2, 0, 0) for each in odom.messages())

        wait_for(drives)
