"""What a script sends to the sim."""

import math
from functools import partial
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


def _counts(refused: int, status: CommandStatus) -> bool:
    return status.refused.get("not finite") == refused


def test_a_command_that_is_not_finite_moves_nothing_and_is_counted(
    wire: Wire, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    start_sim(wire)
    robot, accepted = Robot(wire.bus("watcher")), 0
    for count, (name, bad) in enumerate(zip(WIRES, (math.nan, -math.inf), strict=True), 1):
        monkeypatch.setattr(contexts, "connection", wire.connection._replace(wire=name))
        node = Node(f"tom_{name}", context=context)
        publisher = node.create_publisher(Twist, "cmd_vel", 10)
        wait_for(publisher.get_subscription_count)
        publisher.publish(Twist(linear=Vector3(x=bad)))
        status = robot.status_when(partial(_counts, count))
        assert status.last_refusal.startswith(f"tom_{name}@")
        assert status.last_refusal.endswith("linear.x is not a finite number")
        assert status.accepted == accepted
        assert rests(robot.odom.next())
        odom = robot.odom.from_now()

        def drives(publisher: Any = publisher, odom: Any = odom) -> bool:
            publisher.publish(Twist(linear=Vector3(x=0.2)))
            return any(moves(each, 0.2, 0, 0) for each in odom.messages())

        wait_for(drives)
        accepted = robot.status_when(lambda status: not status.obeyed).accepted
