"""What is told where a script asks for something that is not there: the name, what there is instead, and the page."""

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from holozen.interfaces.registry import closest
from holozen.ros.table import MODULES

PAGE = "docs/coming-from-ros.md"
ACTIONS = "there are no actions here; use a service, or a topic for the goal and one for the progress"
ROS_1 = "this is of ROS 1; here is ROS 2's rclpy"

HINTS = {
    "actionlib": ACTIONS,
    "ament_index_python.resources": "ament_index_python.packages finds the folders of packages",
    "cv_bridge": "numpy.frombuffer(image.data, 'uint8').reshape(image.height, image.width, -1) is a colour image",
    "launch_xml": "launch files are in Python here",
    "launch_yaml": "launch files are in Python here",
    "message_filters": "keep the last message of each topic in its callback, and compare their stamps",
    "rclpy.action": ACTIONS,
    "rclpy.lifecycle": "there are no lifecycle nodes here; use rclpy.node.Node",
    "rclpy.serialization": "holozen.codec.encode and holozen.codec.decode do this",
    "rosbag2_py": "`holozen record` and `holozen replay` do this",
    "rosidl_runtime_py": "holozen.ros.generated.find gives the class of a name such as 'geometry_msgs/msg/Twist'",
    "rospkg": "ament_index_python.packages finds the folders of packages",
    "rospy": ROS_1,
    "roslib": ROS_1,
    "tf": f"{ROS_1}, tf2_ros and tf_transformations",
    "tf2_py": "its exceptions and Buffer are in tf2_ros",
}
"""Module of ROS that is not here -> what there is instead."""

WAITABLES = "what is not a topic, service or timer wakes the spin with create_guard_condition(callback).trigger()"
CLIENTS = "who asks does not stand in the graph, only who serves: count_services, get_service_names_and_types"

OF_NODE = {
    "add_waitable": WAITABLES,
    "count_clients": CLIENTS,
    "get_client_names_and_types_by_node": CLIENTS,
    "get_clients_info_by_service": CLIENTS,
    "get_node_names_and_namespaces_with_enclaves": "there are no enclaves; use get_node_names_and_namespaces",
    "get_servers_info_by_service": "get_service_names_and_types_by_node says what a node serves",
    "handle": "there is no C library below it",
    "remove_waitable": WAITABLES,
    "waitables": WAITABLES,
}
"""Attribute of ROS's Node that is not here -> what there is instead."""

INNER = {
    "arm", "beginning_execution", "changed", "check_may_speak", "check_running", "check_signal", "close_all", "closed",
    "ending_execution", "entities", "interrupt", "is_passed", "opened", "silence", "take", "threads", "unwatch",
    "watch",
}  # fmt: skip
"""What classes have for one another, and not for scripts."""


class Told:
    """A class of ROS whose objects say what there is instead of an attribute that is not here."""

    __slots__ = ()

    if not TYPE_CHECKING:  # else every name would do

        def __getattr__(self, name: str) -> Any:
            # Without its name: Python would guess once more.
            raise AttributeError(of_object(type(self), name), name="")


def in_module(module: str, name: str, known: Iterable[str]) -> str:
    """The line for a name that a module of ROS does not have here."""
    full = f"{module}.{name}"
    return f"{module} has no {name!r} here{_instead(full, name, module, known)}; see {PAGE}"


def of_object(kind: type, name: str) -> str:
    """The line for an attribute that objects of a class do not have, which may be a script's own."""
    if name == "_holozen":
        begin = "call super().__init__('name_of_the_node') in the __init__"
        return f"{begin} of {kind.__name__} before anything of Node is used"
    ours = next(base for base in kind.__mro__ if base.__module__.startswith("holozen."))
    lacks = f"{kind.__name__!r} object has no attribute {name!r}"
    if name.startswith("_"):
        return lacks
    if name in OF_NODE and ours.__name__ == "Node":
        return f"{lacks}; {OF_NODE[name]}; see {PAGE}"
    known = (each for each in dir(kind) if each[0] != "_" and each not in INNER)
    return f"{lacks}{closest(name, known)}; what {ours.__name__} has here: {PAGE}"


def _instead(full: str, name: str, module: str, known: Iterable[str]) -> str:
    if full in HINTS:
        return f"; {HINTS[full]}"
    if place := _elsewhere(name, module):
        return f"; it is in {place}"
    modules = (each for each in MODULES if each.startswith(f"{module}."))
    return closest(name, [*known, *modules])


def _elsewhere(name: str, module: str) -> str:
    """The module of the same package that has this name."""
    top = module.partition(".")[0]
    for other, ours in MODULES.items():
        if other.partition(".")[0] == top and name in import_module(ours).__all__:
            return other
    return ""
