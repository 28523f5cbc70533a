"""The one table of ROS's modules: their names, and which of ours stands behind each.

What a module of ours lists in `__all__` is what scripts find there; docs and tests read it from here too.
"""

MODULES = {
    "rclpy": "holozen.ros.rclpy",
    "rclpy.callback_groups": "holozen.ros.callback_groups",
    "rclpy.client": "holozen.ros.client",
    "rclpy.clock": "holozen.ros.clock",
    "rclpy.clock_type": "holozen.ros.clock_type",
    "rclpy.constants": "holozen.ros.duration",
    "rclpy.context": "holozen.ros.context",
    "rclpy.duration": "holozen.ros.duration",
    "rclpy.exceptions": "holozen.ros.exceptions",
    "rclpy.executors": "holozen.ros.executors",
    "rclpy.guard_condition": "holozen.ros.guard_condition",
    "rclpy.impl": "holozen.ros.severity",
    "rclpy.impl.logging_severity": "holozen.ros.severity",
    "rclpy.impl.rcutils_logger": "holozen.ros.logging",
    "rclpy.logging": "holozen.ros.logging",
    "rclpy.node": "holozen.ros.node",
    "rclpy.parameter": "holozen.ros.parameter",
    "rclpy.publisher": "holozen.ros.publisher",
    "rclpy.qos": "holozen.ros.qos",
    "rclpy.service": "holozen.ros.service",
    "rclpy.signals": "holozen.ros.signals",
    "rclpy.subscription": "holozen.ros.subscription",
    "rclpy.task": "holozen.ros.task",
    "rclpy.time": "holozen.ros.time",
    "rclpy.time_source": "holozen.ros.time_source",
    "rclpy.timer": "holozen.ros.timer",
    "rclpy.topic_endpoint_info": "holozen.ros.topic_endpoint_info",
    "rclpy.utilities": "holozen.ros.rclpy",
    "rclpy.wait_for_message": "holozen.ros.wait_for_message",
    "tf2_ros": "holozen.ros.tf2_ros",
    "tf2_ros.buffer": "holozen.ros.tf2_ros",
    "tf2_ros.static_transform_broadcaster": "holozen.ros.tf2_ros",
    "tf2_ros.transform_broadcaster": "holozen.ros.tf2_ros",
    "tf2_ros.transform_listener": "holozen.ros.tf2_ros",
    "tf2_geometry_msgs": "holozen.ros.tf2_geometry_msgs",
    "tf2_geometry_msgs.tf2_geometry_msgs": "holozen.ros.tf2_geometry_msgs",
    "tf_transformations": "holozen.ros.tf_transformations",
    "ament_index_python": "holozen.ros.ament_index_python",
    "ament_index_python.packages": "holozen.ros.ament_index_python",
    "launch": "holozen.ros.launch.description",
    "launch.actions": "holozen.ros.launch.actions",
    "launch.conditions": "holozen.ros.launch.conditions",
    "launch.event_handlers": "holozen.ros.launch.events",
    "launch.events": "holozen.ros.launch.events",
    "launch.launch_context": "holozen.ros.launch.description",
    "launch.launch_description": "holozen.ros.launch.description",
    "launch.launch_description_sources": "holozen.ros.launch.sources",
    "launch.some_substitutions_type": "holozen.ros.launch.description",
    "launch.substitutions": "holozen.ros.launch.substitutions",
    "launch.utilities": "holozen.ros.launch.description",
    "launch_ros": "holozen.ros.launch.nodes",
    "launch_ros.actions": "holozen.ros.launch.nodes",
    "launch_ros.descriptions": "holozen.ros.launch.nodes",
    "launch_ros.parameter_descriptions": "holozen.ros.launch.nodes",
    "launch_ros.substitutions": "holozen.ros.launch.substitutions",
}
"""ROS's module -> ours. A name that ends before another one's dot is a package."""

_OF_TF2_ROS = {
    "geometry_msgs.msg": ["TransformStamped"],
    "rclpy.duration": ["Duration"],
    "rclpy.node": ["Node"],
    "rclpy.qos": ["DurabilityPolicy", "HistoryPolicy", "QoSProfile"],
    "rclpy.task": ["Future"],
    "rclpy.time": ["Time"],
    "tf2_msgs.msg": ["TFMessage"],
}

IMPORTED: dict[str, dict[str, list[str]]] = {
    "rclpy.client": {
        "rclpy.callback_groups": ["CallbackGroup"],
        "rclpy.context": ["Context"],
        "rclpy.qos": ["QoSProfile"],
        "rclpy.task": ["Future"],
    },
    "rclpy.clock": {"rclpy.context": ["Context", "get_default_context"]},
    "rclpy.executors": {
        "rclpy.client": ["Client"],
        "rclpy.clock": ["Clock", "ClockType"],
        "rclpy.context": ["Context", "get_default_context"],
        "rclpy.exceptions": ["InvalidHandle"],
        "rclpy.guard_condition": ["GuardCondition"],
        "rclpy.node": ["Node"],
        "rclpy.service": ["Service"],
        "rclpy.subscription": ["Subscription"],
        "rclpy.task": ["Future", "Task"],
        "rclpy.timer": ["Timer"],
    },
    "rclpy.node": {
        "rcl_interfaces.msg": [
            "FloatingPointRange", "IntegerRange", "ListParametersResult", "ParameterDescriptor", "ParameterEvent",
            "ParameterType", "ParameterValue", "SetParametersResult",
        ],
        "rclpy.callback_groups": ["CallbackGroup", "MutuallyExclusiveCallbackGroup", "ReentrantCallbackGroup"],
        "rclpy.client": ["Client"],
        "rclpy.clock": ["Clock", "ROSClock"],
        "rclpy.constants": ["S_TO_NS"],
        "rclpy.context": ["Context", "get_default_context"],
        "rclpy.exceptions": [
            "InvalidHandle", "InvalidParameterException", "InvalidParameterTypeException",
            "InvalidParameterValueException", "InvalidTopicNameException", "NodeNameNonExistentError",
            "NotInitializedException", "ParameterAlreadyDeclaredException", "ParameterImmutableException",
            "ParameterNotDeclaredException", "ParameterUninitializedException",
        ],
        "rclpy.executors": ["Executor"],
        "rclpy.guard_condition": ["GuardCondition"],
        "rclpy.logging": ["get_logger"],
        "rclpy.parameter": ["PARAMETER_SEPARATOR_STRING", "Parameter"],
        "rclpy.publisher": ["Publisher"],
        "rclpy.qos": ["QoSProfile", "qos_profile_parameter_events", "qos_profile_services_default"],
        "rclpy.service": ["Service"],
        "rclpy.subscription": ["Subscription"],
        "rclpy.task": ["Future"],
        "rclpy.time_source": ["TimeSource"],
        "rclpy.timer": ["Rate", "Timer"],
        "rclpy.topic_endpoint_info": ["TopicEndpointInfo"],
    },
    "rclpy.parameter": {"rcl_interfaces.msg": ["ParameterType", "ParameterValue"]},
    "rclpy.publisher": {"rclpy.callback_groups": ["CallbackGroup"], "rclpy.qos": ["QoSProfile"]},
    "rclpy.service": {"rclpy.callback_groups": ["CallbackGroup"], "rclpy.qos": ["QoSProfile"]},
    "rclpy.subscription": {"rclpy.callback_groups": ["CallbackGroup"], "rclpy.qos": ["QoSProfile"]},
    "rclpy.timer": {
        "rclpy.callback_groups": ["CallbackGroup"],
        "rclpy.clock": ["Clock"],
        "rclpy.context": ["Context"],
    },
    "tf2_geometry_msgs": {
        "geometry_msgs.msg": [
            "PointStamped", "PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "Vector3Stamped",
        ]
    },
    "tf2_ros": _OF_TF2_ROS,
    "tf2_ros.buffer": _OF_TF2_ROS,
    "tf2_ros.transform_listener": _OF_TF2_ROS,
}  # fmt: skip
"""ROS's module -> another one -> the names of the other that it has too, because it imports them. Scripts use that."""


def imported(module: str) -> dict[str, str]:
    """Name -> the module that it is of, for what a module has because it imports it."""
    return {name: other for other, names in IMPORTED.get(module, {}).items() for name in names}
