"""Whoever uses an attribute that an object of ROS's does not have here is told, and pointed to what there is."""

from typing import Any

import pytest

from holozen.ros import generated, rclpy
from holozen.ros.duration import Duration
from holozen.ros.logging import get_logger
from holozen.ros.qos import QoSProfile
from holozen.ros.task import Future
from holozen.ros.tf2_buffer import Buffer
from holozen.ros.time import Time
from holozen.testing import Wire

PAGE = "docs/coming-from-ros.md"
OBJECTS = {
    "Time": (Time(), "to_mesg", "to_msg"),
    "Duration": (Duration(), "nanosecond", "nanoseconds"),
    "RcutilsLogger": (get_logger("a"), "warnn", "warn"),
    "QoSProfile": (QoSProfile(depth=1), "dept", "depth"),
    "Future": (Future(), "results", "result"),
    "Buffer": (Buffer(), "lookup_transforms", "lookup_transform"),
}


def lacks(something: Any, name: str) -> str:
    with pytest.raises(AttributeError) as error:
        getattr(something, name)
    assert (error.value.name, hasattr(something, name)) == ("", False), "Python would guess once more"
    return str(error.value)


@pytest.mark.parametrize("kind", OBJECTS)
def test_the_nearest_name_and_the_page_are_told(kind: str) -> None:
    something, name, nearest = OBJECTS[kind]
    told = f"{kind!r} object has no attribute {name!r}; did you mean {nearest}?; what {kind} has here: {PAGE}"
    assert lacks(something, name) == told
    assert lacks(something, "zzz") == f"{kind!r} object has no attribute 'zzz'; what {kind} has here: {PAGE}"
    assert lacks(something, "_zzz") == f"{kind!r} object has no attribute '_zzz'"


def test_a_scripts_own_node_is_told_by_its_name(ros: Wire) -> None:
    class Robot(rclpy.Node):
        pass

    robot = Robot("robot")
    assert lacks(robot, "create_subscriber").startswith(
        "'Robot' object has no attribute 'create_subscriber'; did you mean create_subscription?; what Node has here"
    )
    assert lacks(robot, "handle").endswith(f"; see {PAGE}")


def test_a_time_for_a_stamp_is_told_how_to_be_written() -> None:
    with pytest.raises(AssertionError, match=r"; write \.to_msg\(\) behind it$"):
        generated.find("std_msgs/msg/Header")(stamp=Time())
