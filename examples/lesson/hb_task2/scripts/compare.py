#!/usr/bin/env python3
"""Puts a picture of the camera beside a drawing of what it must show, by odom, into compare.png."""

import math

import cv2
import numpy as np
import rclpy
from cv_bridge import CvBridge
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Image

CAMERA, FIELD_OF_VIEW = 2.66, 0.85  # m above the ground, rad
SHEET, MARKER = 0.06, 0.151  # m above the ground
HALF = 0.2 / 2 * 192 / 240  # m from the middle of a marker to the edge of its black square


class Compare(Node):
    def __init__(self):
        super().__init__("compare")
        self.poses, self.picture = {}, None
        for robot in (1, 2, 3):
            self.create_subscription(
                Odometry, f"/hb_bot_{robot}/odom", lambda msg, r=robot: self.note(r, msg), 1
            )
        self.create_subscription(Image, "camera/image_raw", self.take, 1)

    def note(self, robot, msg):
        q, at = msg.pose.pose.orientation, msg.pose.pose.position
        self.poses[robot] = at.x, at.y, 2 * math.atan2(q.z, q.w)

    def take(self, msg):
        self.picture = CvBridge().imgmsg_to_cv2(msg, "bgr8")

    def place(self, x, y, z):
        """The pixel (right, down) at which a point of the world must be, from the middle of the
        first one.
        """
        size = self.picture.shape[0]
        pixels = size / 2 / math.tan(FIELD_OF_VIEW / 2) / (CAMERA - z)  # in a metre
        return (size - 1) / 2 - y * pixels, (size - 1) / 2 - x * pixels

    def marker(self, robot):
        """The corners (4, 2) of a marker in pixels, from its top left round."""
        x, y, yaw = self.poses[robot]
        c, s = math.cos(yaw), math.sin(yaw)
        corners = ((-HALF, HALF), (HALF, HALF), (HALF, -HALF), (-HALF, -HALF))
        return np.array(
            [self.place(x + a * c - b * s, y + a * s + b * c, MARKER) for a, b in corners]
        )

    def draw(self):
        drawing = np.full_like(self.picture, 178)
        sheet = np.array([self.place(x, y, SHEET) for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))])
        cv2.fillPoly(drawing, [np.round(sheet).astype(int)], (230, 230, 230))
        detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
        found, numbers, _ = detector.detectMarkers(cv2.cvtColor(self.picture, cv2.COLOR_BGR2GRAY))
        for robot in self.poses:
            wanted = self.marker(robot)
            cv2.fillPoly(drawing, [np.round(wanted).astype(int)], (0, 0, 0))
            at = tuple(int(value) for value in wanted.mean(axis=0))
            cv2.putText(drawing, str(robot), at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255))
            seen = [
                corners[0]
                for corners, number in zip(found, numbers.ravel(), strict=True)
                if number == robot
            ]
            off = np.hypot(*(seen[0] - wanted).T).max()
            print(
                f"hb_bot_{robot}: the corners of its marker are within {off:.1f} pixels of where "
                "they must be"
            )
        cv2.imwrite("compare.png", np.hstack([self.picture, drawing]))


rclpy.init()
node = Compare()
while node.picture is None or len(node.poses) < 3:
    rclpy.spin_once(node)
node.draw()
