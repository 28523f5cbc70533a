"""ROS 2's Python packages over Zenoh, for scripts that begin with `import rclpy`.

The modules stand under ROS's own names (`holozen.ros.rclpy.node` is `rclpy.node`), and `importer`
makes them importable under those names in the process of `holozen run` or `holozen launch`, and in
no other.
"""
