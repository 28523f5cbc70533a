"""A node whose topics only a robot with a name has is told of that robot's."""

import threading
from types import SimpleNamespace
from typing import Any

import pytest

from holozen.messages import Clock, Odometry, TFMessage, Twist
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy import topic_check
from holozen.testing import Wire, wait_for
from holozen.testing.process import PATIENCE


def test_topics_that_only_a_robot_with_a_name_has_are_logged_with_its_own(
    ros: Wire, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    made = threading.Event()  # all topics of both nodes
    waker = SimpleNamespace(wait=lambda _: not made.wait(PATIENCE), wake=made.set)
    monkeypatch.setattr(topic_check, "Waker", lambda: waker)
    sim = ros.bus("sim", lasting=True)
    written = [
        sim.publisher("Fred/odom", Odometry),
        sim.publisher("Fred/tf", TFMessage),
        sim.publisher("clock", Clock),
    ]
    read = [sim.subscribe("Fred/cmd_vel", Twist), sim.subscribe("*/cmd_vel", Twist)]

    def node(name: str, prefix: str) -> Any:
        made = rclpy.create_node(name)
        made.create_publisher(find("geometry_msgs/msg/Twist"), f"{prefix}cmd_vel", 1)
        for topic, kind in (("odom", "nav_msgs/msg/Odometry"), ("tf", "tf2_msgs/msg/TFMessage")):
            made.create_subscription(find(kind), f"{prefix}{topic}", print, 1)
        made.create_subscription(find("rosgraph_msgs/msg/Clock"), "clock", print, 1)
        return made

    nodes = [node("ann", "Fred/"), node("tom", "")]
    made.set()
    (line,) = wait_for(lambda: capfd.readouterr().err.splitlines())
    rules = "-r /cmd_vel:=/Fred/cmd_vel -r /odom:=/Fred/odom -r /tf:=/Fred/tf"
    what = "nothing reads cmd_vel, nothing publishes odom and tf; a robot with a name has its own"
    assert line.partition("[tom]: ")[2] == f"{what}: remap with --ros-args {rules}"
    assert len(written) + len(read) + len(nodes) == 7
    remapped = rclpy.create_node("eve", namespace="lab", cli_args=["--ros-args", *rules.split()])
    assert remapped.resolve_topic_name("/tf") == "/Fred/tf"
