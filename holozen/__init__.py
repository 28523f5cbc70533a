"""Drive and simulate holonomic robots over Zenoh, with the topics and services of ROS."""
