#!/usr/bin/env python3
"""Draws a shape with each robot: from where the camera sees it to forces on its three wheels."""

import math
import time

import rclpy
from geometry_msgs.msg import Pose2D, Wrench
from hb_interfaces.srv import NextGoal
from rclpy.node import Node

ARM = 0.09  # m from the middle to a wheel
WHEELS = {"left": math.pi / 3, "right": -math.pi / 3, "rear": math.pi}  # the angle of its place
KP_LINEAR, KP_ANGULAR = 2.0, 0.3  # 1/s
FASTEST = 0.2  # m/s
# N for each m/s: the drive stops the 3 kg 20 times a second, so F / m / 40 is their speed on
# average
GAIN = 80.0
NEAR = 0.02  # m to a goal
FRESH = 0.5  # s for which a pose counts


class Robot:
    def __init__(self, node, number):
        self.node, self.name = node, f"hb_bot_{number}"
        self.forces = {
            wheel: node.create_publisher(Wrench, f"/{self.name}/{wheel}_wheel_force", 10)
            for wheel in WHEELS
        }
        self.client = node.create_client(NextGoal, f"/{self.name}/next_goal")
        self.pose, self.seen, self.index, self.goal, self.last = None, 0.0, 0, None, False
        node.create_subscription(Pose2D, f"/detected_aruco_{number}", self.look, 10)
        self.client.wait_for_service()
        self.ask()

    def look(self, pose):
        self.pose, self.seen = pose, time.monotonic()

    def ask(self):
        self.goal = None
        request = NextGoal.Request(request_goal=self.index)
        self.client.call_async(request).add_done_callback(
            lambda future: setattr(self, "goal", future.result())
        )

    def drive(self):
        velocity = (0.0, 0.0, 0.0)
        if self.goal and time.monotonic() - self.seen < FRESH:
            velocity = self.towards(self.goal)
        vx, vy, turn = velocity
        for wheel, angle in WHEELS.items():
            # Inverse kinematics: how fast the wheel has to roll, to its left as seen from the
            # middle.
            rolls = -math.sin(angle) * vx + math.cos(angle) * vy + ARM * turn
            force = Wrench()
            force.force.x = GAIN * rolls
            self.forces[wheel].publish(force)

    def towards(self, goal):
        """The velocity in the robot's own frame: in m/s forward and left, and in rad/s."""
        x, y, theta = goal.x_goal - self.pose.x, goal.y_goal - self.pose.y, self.pose.theta
        distance, turn = math.hypot(x, y), math.remainder(goal.theta_goal - theta, math.tau)
        if distance < NEAR:
            if self.last:
                self.node.get_logger().info(f"{self.name} has drawn its shape")
            self.last = bool(goal.end_of_list)
            self.index = 0 if self.last else self.index + 1
            self.ask()
        share = min(KP_LINEAR, FASTEST / max(distance, 1e-6))
        ahead, left = (
            math.cos(theta) * x + math.sin(theta) * y,
            math.cos(theta) * y - math.sin(theta) * x,
        )
        return share * ahead, share * left, KP_ANGULAR * turn


class HBController(Node):
    def __init__(self):
        super().__init__("hb_controller")
        self.robots = [Robot(self, number) for number in (1, 2, 3)]
        self.create_timer(0.05, self.drive)

    def drive(self):
        for robot in self.robots:
            robot.drive()


rclpy.init()
rclpy.spin(HBController())
