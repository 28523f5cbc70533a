#!/usr/bin/env python3
"""Drives from the keyboard: i , forward and backward, J L sideways, j l turn, k stops."""

import sys
import termios
import threading
import tty

import geometry_msgs.msg
import rclpy

MOVES = {
    "i": (1, 0, 0),
    ",": (-1, 0, 0),
    "J": (0, 1, 0),
    "L": (0, -1, 0),
    "j": (0, 0, 1),
    "l": (0, 0, -1),
}


def get_key(settings):
    tty.setraw(sys.stdin.fileno())
    key = sys.stdin.read(1)
    termios.tcsetattr(sys.stdin, termios.TCSADRAIN, settings)
    return key


def drive(node, publisher, msg, settings, speed, turn):
    stamped = hasattr(msg, "twist")
    twist = msg.twist if stamped else msg
    print("i , J L j l drive, k stops, Ctrl-C ends")
    try:
        while (key := get_key(settings)) != "\x03":
            x, y, z = MOVES.get(key, (0, 0, 0))
            if stamped:
                msg.header.stamp = node.get_clock().now().to_msg()
            twist.linear.x = x * speed
            twist.linear.y = y * speed
            twist.angular.z = z * turn
            publisher.publish(msg)
    finally:
        twist.linear.x = twist.linear.y = twist.angular.z = 0.0
        publisher.publish(msg)


def main():
    settings = termios.tcgetattr(sys.stdin)

    rclpy.init()
    node = rclpy.create_node("teleop_keys")
    stamped = node.declare_parameter("stamped", False).value
    speed = node.declare_parameter("speed", 0.5).value
    turn = node.declare_parameter("turn", 1.0).value
    kind = geometry_msgs.msg.TwistStamped if stamped else geometry_msgs.msg.Twist
    publisher = node.create_publisher(kind, "cmd_vel", 10)
    spinner = threading.Thread(target=rclpy.spin, args=(node,))
    spinner.start()

    try:
        drive(node, publisher, kind(), settings, speed, turn)
    finally:
        rclpy.shutdown()
        spinner.join()
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, settings)


if __name__ == "__main__":
    main()
