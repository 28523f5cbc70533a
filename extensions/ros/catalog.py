"""Which of ROS's modules and names exist here, and the hints for those that do not.

What a module of ours lists in `__all__` is what scripts find there; the documentation is generated
from it.
"""

from typing import TYPE_CHECKING, Any

from holozen.suggest import suggest

PAGE = "docs/coming-from-ros.md"

SAME = (
    "rclpy",
    "rclpy.action",
    "rclpy.action.client",
    "rclpy.action.server",
    "rclpy.callback_groups",
    "rclpy.client",
    "rclpy.clock",
    "rclpy.context",
    "rclpy.exceptions",
    "rclpy.executors",
    "rclpy.logging",
    "rclpy.node",
    "rclpy.parameter",
    "rclpy.publisher",
    "rclpy.qos",
    "rclpy.service",
    "rclpy.subscription",
    "rclpy.task",
    "rclpy.time",
    "rclpy.timer",
    "tf2_ros",
    "tf2_geometry_msgs",
    "tf_transformations",
    "ament_index_python",
    "launch",
    "launch.actions",
    "launch.conditions",
    "launch.event_handlers",
    "launch.launch_description_sources",
    "launch.substitutions",
    "launch_ros",
    "xacro",
    "cv_bridge",
)
"""ROS's modules whose counterpart has the same name below `holozen.ros`."""

ALIASES = {
    "cv_bridge.boost": "cv_bridge",
    "cv_bridge.boost.cv_bridge_boost": "cv_bridge",
    "cv_bridge.core": "cv_bridge",
    "rclpy.action.graph": "rclpy.action",
    "rclpy.clock_type": "rclpy.time",
    "rclpy.constants": "rclpy.time",
    "rclpy.duration": "rclpy.time",
    "rclpy.guard_condition": "rclpy.waitable",
    "rclpy.impl": "rclpy.logging",
    "rclpy.impl.logging_severity": "rclpy.logging",
    "rclpy.impl.rcutils_logger": "rclpy.logging",
    "rclpy.signals": "rclpy.context",
    "rclpy.time_source": "rclpy.clock",
    "rclpy.topic_endpoint_info": "rclpy.node",
    "rclpy.utilities": "rclpy",
    "rclpy.wait_for_message": "rclpy.subscription",
    "tf2_ros.buffer": "tf2_ros",
    "tf2_ros.static_transform_broadcaster": "tf2_ros",
    "tf2_ros.transform_broadcaster": "tf2_ros",
    "tf2_ros.transform_listener": "tf2_ros",
    "tf2_geometry_msgs.tf2_geometry_msgs": "tf2_geometry_msgs",
    "ament_index_python.packages": "ament_index_python",
    "launch.events": "launch.event_handlers",
    "launch.launch_context": "launch",
    "launch.launch_description": "launch",
    "launch.launch_service": "launch",
    "launch.some_substitutions_type": "launch",
    "launch.utilities": "launch",
    "launch_ros.actions": "launch_ros",
    "launch_ros.descriptions": "launch_ros",
    "launch_ros.parameter_descriptions": "launch_ros",
    "launch_ros.substitutions": "launch.substitutions",
}
"""ROS's modules whose names are in another one here."""

MODULES = {name: f"holozen.ros.{ALIASES.get(name, name)}" for name in sorted((*SAME, *ALIASES))}
"""ROS's module -> ours. A module that another one's name begins with, up to a dot, is a package."""

_TF2_ROS = (
    "DurabilityPolicy",
    "Duration",
    "HistoryPolicy",
    "Node",
    "QoSProfile",
    "Future",
    "Time",
    "TFMessage",
    "TransformStamped",
)

REEXPORTS: dict[str, tuple[str, ...]] = {
    "rclpy.action.client": ("GoalStatus",),
    "rclpy.action.server": ("GoalInfo", "GoalStatus"),
    "rclpy.client": ("CallbackGroup", "Context", "Future", "QoSProfile"),
    "rclpy.clock": ("ClockType", "Context", "Duration", "Time", "get_default_context"),
    "rclpy.executors": (
        "Client",
        "Clock",
        "ClockType",
        "Context",
        "ExternalShutdownException",
        "Future",
        "GuardCondition",
        "InvalidHandle",
        "Node",
        "Service",
        "Subscription",
        "Task",
        "Timer",
        "get_default_context",
    ),
    "rclpy.node": (
        "CallbackGroup",
        "Client",
        "Clock",
        "Context",
        "Executor",
        "FloatingPointRange",
        "Future",
        "GuardCondition",
        "IntegerRange",
        "InvalidHandle",
        "InvalidParameterException",
        "InvalidParameterTypeException",
        "InvalidParameterValueException",
        "InvalidTopicNameException",
        "ListParametersResult",
        "MutuallyExclusiveCallbackGroup",
        "NodeNameNonExistentError",
        "NotInitializedException",
        "PARAMETER_SEPARATOR_STRING",
        "Parameter",
        "ParameterAlreadyDeclaredException",
        "ParameterDescriptor",
        "ParameterEvent",
        "ParameterImmutableException",
        "ParameterNotDeclaredException",
        "ParameterType",
        "ParameterUninitializedException",
        "ParameterValue",
        "Publisher",
        "QoSProfile",
        "ROSClock",
        "Rate",
        "ReentrantCallbackGroup",
        "S_TO_NS",
        "Service",
        "SetParametersResult",
        "Subscription",
        "TimeSource",
        "Timer",
        "get_default_context",
        "get_logger",
        "qos_profile_parameter_events",
        "qos_profile_services_default",
    ),
    "rclpy.parameter": ("ParameterType", "ParameterValue"),
    "rclpy.publisher": ("CallbackGroup", "QoSProfile"),
    "rclpy.qos": ("Duration",),
    "rclpy.service": ("CallbackGroup", "QoSProfile"),
    "rclpy.subscription": ("CallbackGroup", "QoSProfile"),
    "rclpy.timer": ("CallbackGroup", "Clock", "Context"),
    "tf2_geometry_msgs": (
        "PointStamped",
        "PoseStamped",
        "PoseWithCovarianceStamped",
        "TransformStamped",
        "Vector3Stamped",
    ),
    "tf2_ros": _TF2_ROS,
    "tf2_ros.buffer": _TF2_ROS,
    "tf2_ros.transform_listener": _TF2_ROS,
}
"""ROS's module -> names that it imports from others, and that scripts therefore find in it as well.
"""

MESSAGES = {
    "action_msgs.msg": ("GoalInfo", "GoalStatus"),
    "rcl_interfaces.msg": (
        "FloatingPointRange",
        "IntegerRange",
        "ListParametersResult",
        "ParameterDescriptor",
        "ParameterEvent",
        "ParameterType",
        "ParameterValue",
        "SetParametersResult",
    ),
    "geometry_msgs.msg": REEXPORTS["tf2_geometry_msgs"],
    "tf2_msgs.msg": ("TFMessage",),
}
"""The messages among the re-exported names, by module; all others are rclpy's."""

COMPONENTS = (
    "components are C++ and do not run here; start a Python script as a separate Node for each"
)
MOVEIT = "there is no MoveIt here"
NAV2 = "there is no Nav2 here; `holozen controller` serves navigate_to_pose and follow_waypoints"
ROS_1 = "this belongs to ROS 1; use ROS 2's rclpy"

HINTS = {
    "actionlib": f"{ROS_1}, which has actions in rclpy.action",
    "ament_index_python.resources": "ament_index_python.packages finds the folders of packages",
    "gazebo_msgs.srv": "simulation_interfaces.srv has SpawnEntity, DeleteEntity, GetEntityState "
    "and SetEntityState",
    "gz": "this is Gazebo's own transport; use rclpy, or holozen.bus",
    "interactive_markers": "there are no interactive markers here; a topic or a service can set "
    "what a marker would",
    "launch_xml": "launch files are in Python here",
    "launch_yaml": "launch files are in Python here",
    "message_filters": "keep the last message of each topic in its callback, and compare their "
    "stamps",
    "moveit_commander": MOVEIT,
    "moveit_configs_utils": MOVEIT,
    "nav2_common": NAV2,
    "nav2_simple_commander": NAV2,
    "rclpy.lifecycle": "there are no lifecycle nodes here; use rclpy.node.Node",
    "rclpy.parameter_client": "create_client(SetParameters, '/NODE/set_parameters') calls it, of "
    "rcl_interfaces.srv",
    "rclpy_components": COMPONENTS,
    "rclpy.serialization": "holozen.messages.codec.encode and decode do this",
    "rosbag2_py": "`holozen record` and `holozen replay` do this",
    "rosidl_runtime_py": "holozen.ros.generated.find gives the class of a name such as "
    "'geometry_msgs/msg/Twist'",
    "rospkg": "ament_index_python.packages finds the folders of packages",
    "rospy": ROS_1,
    "roslib": ROS_1,
    "tf": f"{ROS_1}, tf2_ros and tf_transformations",
    "tf2_py": "its exceptions and Buffer are in tf2_ros",
}
"""A module of ROS that does not exist here -> what to use instead."""

_SAME_ON_PYPI = (
    "casadi",
    "click",
    "colorama",
    "control",
    "cvxpy",
    "depthai",
    "evdev",
    "filterpy",
    "flask",
    "gymnasium",
    "ikpy",
    "imutils",
    "inputs",
    "jax",
    "keras",
    "keyboard",
    "lxml",
    "matplotlib",
    "mediapipe",
    "mujoco",
    "networkx",
    "numba",
    "numpy",
    "open3d",
    "openai",
    "osqp",
    "pandas",
    "plotly",
    "psutil",
    "pybullet",
    "pygame",
    "pynput",
    "pyproj",
    "pyqtgraph",
    "pyquaternion",
    "pyrealsense2",
    "pyttsx3",
    "qpsolvers",
    "readchar",
    "requests",
    "rich",
    "rosbags",
    "scipy",
    "seaborn",
    "shapely",
    "smbus2",
    "sounddevice",
    "sympy",
    "tensorflow",
    "termcolor",
    "torch",
    "tqdm",
    "transformations",
    "transforms3d",
    "trimesh",
    "ultralytics",
    "utm",
    "websockets",
)
PYPI = dict.fromkeys(_SAME_ON_PYPI, "") | {
    "PIL": "pillow",
    "PyQt5": "PyQt5",
    "PyQt6": "PyQt6",
    "PySide6": "PySide6",
    "RPi": "RPi.GPIO",
    "can": "python-can",
    "cv2": "opencv-python-headless",
    "paho": "paho-mqtt",
    "pupil_apriltags": "pupil-apriltags",
    "quaternion": "numpy-quaternion",
    "serial": "pyserial",
    "simple_pid": "simple-pid",
    "skimage": "scikit-image",
    "sklearn": "scikit-learn",
    "speech_recognition": "SpeechRecognition",
    "stable_baselines3": "stable-baselines3",
    "yaml": "PyYAML",
}
"""A module that scripts import and that `pip install` can install -> its name there; empty for the
same one.
"""

ONLY_INTERFACES = {
    "turtlesim": "turtlesim itself is not here: nobody reads turtle1/cmd_vel or publishes "
    "turtle1/pose; "
    "`holozen up` starts a robot with cmd_vel and odom",
}
"""A package whose interfaces are here without its nodes -> what a script that imports them is told.
"""

WAITABLES = (
    "create_guard_condition(callback).trigger() wakes the executor for anything but "
    "topics, services and timers"
)
CLIENTS = "clients are not in the graph, only services: count_services, get_service_names_and_types"

NODE_HINTS = {
    "add_waitable": WAITABLES,
    "count_clients": CLIENTS,
    "get_client_names_and_types_by_node": CLIENTS,
    "get_clients_info_by_service": CLIENTS,
    "get_node_names_and_namespaces_with_enclaves": "there are no enclaves; use "
    "get_node_names_and_namespaces",
    "get_servers_info_by_service": "get_service_names_and_types_by_node lists the services of a "
    "node",
    "handle": "there is no C library below it",
    "remove_waitable": WAITABLES,
    "waitables": WAITABLES,
}
"""An attribute of ROS's Node that does not exist here -> what to use instead."""

INTERNAL = {
    "all_open",
    "arm",
    "beginning_execution",
    "changed",
    "check_running",
    "check_can_publish",
    "check_signal",
    "close_all",
    "closed",
    "detach",
    "ending_execution",
    "entities",
    "interrupt",
    "is_passed",
    "opened",
    "sleep_nanoseconds",
    "take",
    "threads",
    "unwatch",
    "watch",
}
"""Public methods that our classes have for one another, and that are not part of rclpy."""


class HelpfulAttributes:
    """A class of ROS whose AttributeErrors name the nearest attribute, or what to use instead."""

    __slots__ = ()

    if not TYPE_CHECKING:  # a type checker would take any attribute as valid

        def __getattr__(self, name: str) -> Any:
            # An empty name keeps Python from adding a guess of its own.
            raise AttributeError(_missing_attribute(type(self), name), name="")


def _missing_attribute(kind: type, name: str) -> str:
    """The error line for an attribute that a class of ours, or a script's subclass of it, lacks."""
    if name == "_holozen":
        call = "call super().__init__('name_of_the_node') in the __init__"
        return f"{call} of {kind.__name__} before anything of Node is used"
    ours = next(base for base in kind.__mro__ if base.__module__.startswith("holozen."))
    lacks = f"{kind.__name__!r} object has no attribute {name!r}"
    if name.startswith("_"):
        return lacks
    if name in NODE_HINTS and ours.__name__ == "Node":
        return f"{lacks}; {NODE_HINTS[name]}; see {PAGE}"
    known = (each for each in dir(kind) if each[0] != "_" and each not in INTERNAL)
    return f"{lacks}{suggest(name, known)}; what {ours.__name__} has here: {PAGE}"
