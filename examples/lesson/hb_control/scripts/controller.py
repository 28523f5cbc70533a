#!/usr/bin/env python3
"""Drives hb_bot to the goals of next_goal, one after another."""

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from hb_interfaces.srv import NextGoal
from nav_msgs.msg import Odometry
from rclpy.node import Node
from tf_transformations import euler_from_quaternion


class HBController(Node):
    def __init__(self):
        super().__init__("hb_controller")
        self.pose = None
        self.index = 0
        self.vel = Twist()
        self.declare_parameter("kp_linear", 1.5)
        self.declare_parameter("kp_angular", 2.0)
        self.publisher = self.create_publisher(Twist, "/cmd_vel", 10)
        self.subscription = self.create_subscription(Odometry, "/odom", self.odom_callback, 10)
        self.client = self.create_client(NextGoal, "next_goal")
        while not self.client.wait_for_service(timeout_sec=1.0):
            self.get_logger().info("waiting for next_goal")
        self.send_request()

    def send_request(self):
        request = NextGoal.Request()
        request.request_goal = self.index
        self.future = self.client.call_async(request)

    def odom_callback(self, msg):
        q = msg.pose.pose.orientation
        (_roll, _pitch, yaw) = euler_from_quaternion([q.x, q.y, q.z, q.w])
        self.pose = np.array([msg.pose.pose.position.x, msg.pose.pose.position.y, yaw])

    def drive_to(self, goal):
        """Whether the robot is there."""
        error = np.array([goal.x_goal, goal.y_goal, goal.theta_goal]) - self.pose
        error[2] = np.arctan2(np.sin(error[2]), np.cos(error[2]))
        yaw = self.pose[2]
        to_body = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        velocity = to_body @ error[:2] * self.get_parameter("kp_linear").value
        self.vel.linear.x, self.vel.linear.y = velocity
        self.vel.angular.z = error[2] * self.get_parameter("kp_angular").value
        self.publisher.publish(self.vel)
        return np.linalg.norm(error[:2]) < 0.03 and abs(error[2]) < 0.05


def main(args=None):
    rclpy.init(args=args)
    node = HBController()
    goal = None
    while rclpy.ok():
        if node.future.done() and goal is None:
            try:
                goal = node.future.result()
            except Exception as error:
                node.get_logger().error(f"service call failed: {error!r}")
                break
            node.get_logger().info(
                f"goal {node.index}: {goal.x_goal:.2f} {goal.y_goal:.2f} {goal.theta_goal:.2f}"
            )
        rclpy.spin_once(node)
        if goal is not None and node.pose is not None and node.drive_to(goal):
            node.index = 0 if goal.end_of_list == 1 else node.index + 1
            goal = None
            node.send_request()
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
