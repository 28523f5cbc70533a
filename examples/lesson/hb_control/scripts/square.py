#!/usr/bin/env python3
"""Drives a square by time alone: one second forward, one to the left, back, and to the right."""

import rclpy
from geometry_msgs.msg import Twist

SPEED = 0.3  # m/s
SIDES = [(SPEED, 0.0), (0.0, SPEED), (-SPEED, 0.0), (0.0, -SPEED)]

rclpy.init()
node = rclpy.create_node("square")
publisher = node.create_publisher(Twist, "cmd_vel", 10)
start = node.get_clock().now()


def drive():
    seconds = (node.get_clock().now() - start).nanoseconds / 1e9
    msg = Twist()
    if seconds < len(SIDES):
        msg.linear.x, msg.linear.y = SIDES[int(seconds)]
    publisher.publish(msg)
    if seconds > len(SIDES) + 0.5:
        raise SystemExit


timer = node.create_timer(0.05, drive)
try:
    rclpy.spin(node)
except SystemExit:
    node.get_logger().info("done")
node.destroy_node()
rclpy.shutdown()
