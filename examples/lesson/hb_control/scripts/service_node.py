#!/usr/bin/env python3
"""Chooses a shape, publishes its name on /shape, and hands out its corners one by one."""

import math
import random

import rclpy
from hb_interfaces.srv import NextGoal
from rclpy.node import Node
from std_msgs.msg import String

SIDE = 1.0  # m


def polygon(corners):
    radius = SIDE / (2 * math.sin(math.pi / corners))
    angles = [2 * math.pi * corner / corners for corner in range(corners)]
    return [(radius * math.cos(angle), radius * math.sin(angle), angle / 2) for angle in angles]


SHAPES = {"triangle": polygon(3), "square": polygon(4), "hexagon": polygon(6)}


class ServiceNode(Node):
    def __init__(self):
        super().__init__("service_node")
        self.shape = random.choice(list(SHAPES))
        self.goals = SHAPES[self.shape]
        self.publisher = self.create_publisher(String, "/shape", 10)
        self.service = self.create_service(NextGoal, "next_goal", self.next_goal_callback)
        self.timer = self.create_timer(0.5, self.timer_callback)
        self.get_logger().info(f"the shape is a {self.shape}")

    def timer_callback(self):
        msg = String()
        msg.data = self.shape
        self.publisher.publish(msg)

    def next_goal_callback(self, request, response):
        index = request.request_goal % len(self.goals)
        response.x_goal, response.y_goal, response.theta_goal = self.goals[index]
        response.end_of_list = 1 if index == len(self.goals) - 1 else 0
        return response


def main(args=None):
    rclpy.init(args=args)
    node = ServiceNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
