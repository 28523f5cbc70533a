"""ROS 2's Python packages over Zenoh, for scripts that begin with `import rclpy`.

`holozen run` makes them importable in its own process, and nobody else does: the modules here have their own names
(`holozen.ros.node`), and `finder.py` gives them ROS's (`rclpy.node`).
"""
