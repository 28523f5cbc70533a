"""Hashes of types, compared with what rosbags computes and with published values."""

from rosbags.typesys import Stores, get_typestore

from holozen.messages import registry
from holozen.messages.registry import Registry
from holozen.messages.type_hash import type_hash

STORE = get_typestore(Stores.ROS2_JAZZY)
# packages that rosbags does not have
ELSEWHERE = {
    "action_tutorials_interfaces",
    "example_interfaces",
    "gazebo_msgs",
    "holozen",
    "nav2_msgs",
    "simulation_interfaces",
    "turtlesim",
}
# rosbags gives it a char, where ROS 2's .msg files mean uint8 by that word
NOT_AS_ROS = {"std_msgs/msg/Char"}


def test_the_hash_of_every_message_of_ros_is_that_of_rosbags() -> None:
    types = Registry()
    for name in (
        f"{package}/{name}" for package in registry.tables() for name in registry.table(package)
    ):
        if name in STORE.fielddefs and name not in NOT_AS_ROS:
            assert type_hash(types.find(name)) == STORE.hash_rihs01(name), name
        else:
            assert name in NOT_AS_ROS or "/srv/" in name or name.partition("/")[0] in ELSEWHERE, (
                name
            )


def test_hashes_are_those_that_were_published(published: dict[str, str]) -> None:
    types = Registry()
    assert {name: type_hash(types.find(name)) for name in published} == published
