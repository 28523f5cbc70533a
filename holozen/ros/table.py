"""The one table of ROS's modules: their names, and which of ours stands behind each.

What a module of ours lists in `__all__` is what scripts find there; docs and tests read it from here too.
"""

MODULES = {
    "rclpy": "holozen.ros.rclpy",
    "rclpy.callback_groups": "holozen.ros.callback_groups",
    "rclpy.client": "holozen.ros.client",
    "rclpy.clock": "holozen.ros.clock",
    "rclpy.context": "holozen.ros.context",
    "rclpy.duration": "holozen.ros.time",
    "rclpy.exceptions": "holozen.ros.exceptions",
    "rclpy.executors": "holozen.ros.executors",
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
    "rclpy.timer": "holozen.ros.timer",
    "rclpy.utilities": "holozen.ros.rclpy",
    "tf2_ros": "holozen.ros.tf2_ros",
    "tf2_geometry_msgs": "holozen.ros.tf2_geometry_msgs",
    "tf_transformations": "holozen.ros.tf_transformations",
    "ament_index_python": "holozen.ros.ament_index_python",
    "ament_index_python.packages": "holozen.ros.ament_index_python",
    "launch": "holozen.ros.launch.description",
    "launch.actions": "holozen.ros.launch.actions",
    "launch.conditions": "holozen.ros.launch.conditions",
    "launch.launch_description_sources": "holozen.ros.launch.sources",
    "launch.substitutions": "holozen.ros.launch.substitutions",
    "launch_ros": "holozen.ros.launch.nodes",
    "launch_ros.actions": "holozen.ros.launch.nodes",
    "launch_ros.parameter_descriptions": "holozen.ros.launch.nodes",
    "launch_ros.substitutions": "holozen.ros.launch.substitutions",
}
"""ROS's module -> ours. A name that ends before another one's dot is a package."""
