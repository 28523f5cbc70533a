#!/usr/bin/env python3
"""Hands out the corners of a shape to each robot, on hb_bot_1/next_goal to hb_bot_3/next_goal."""

import os
from functools import partial

import rclpy
from ament_index_python.packages import get_package_share_directory
from hb_interfaces.srv import NextGoal
from rclpy.node import Node


def shape_of(robot):
    """The corners x, y, theta of the shape of a robot."""
    path = os.path.join(get_package_share_directory("hb_task2"), "shapes", f"{robot}.txt")
    with open(path) as file:
        return [[float(word) for word in line.split()] for line in file if not line.startswith("#")]


class ServiceNode(Node):
    def __init__(self):
        super().__init__("service_node")
        for robot in (1, 2, 3):
            self.create_service(
                NextGoal, f"hb_bot_{robot}/next_goal", partial(self.answer, shape_of(robot))
            )

    def answer(self, shape, request, response):
        index = request.request_goal % len(shape)
        response.x_goal, response.y_goal, response.theta_goal = shape[index]
        response.end_of_list = int(index == len(shape) - 1)
        return response


rclpy.init()
rclpy.spin(ServiceNode())
