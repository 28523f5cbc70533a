"""The verbs run, launch and ros2."""
