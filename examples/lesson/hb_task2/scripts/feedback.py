#!/usr/bin/env python3
"""Finds the markers of the robots in the pictures of the camera, and publishes where each is on
detected_aruco_N.
"""

import math

import cv2
import rclpy
from cv_bridge import CvBridge
from geometry_msgs.msg import Pose2D
from rclpy.node import Node
from sensor_msgs.msg import Image

HEIGHT = 2.66 - 0.06 - 0.091  # m from the camera down to the markers
FIELD_OF_VIEW = 0.85  # rad


class Feedback(Node):
    def __init__(self):
        super().__init__("feedback")
        self.bridge = CvBridge()
        markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        self.detector = cv2.aruco.ArucoDetector(markers, parameters)
        self.poses = {
            robot: self.create_publisher(Pose2D, f"detected_aruco_{robot}", 10)
            for robot in (1, 2, 3)
        }
        self.create_subscription(Image, "camera/image_raw", self.look, 1)

    def look(self, msg):
        image = self.bridge.imgmsg_to_cv2(msg, "mono8")
        height, width = image.shape
        metres = 2 * HEIGHT * math.tan(FIELD_OF_VIEW / 2) / width  # of a pixel
        found, numbers, _ = self.detector.detectMarkers(image)
        for corners, number in zip(found, [] if numbers is None else numbers.ravel(), strict=True):
            if number in self.poses:
                # The corners of a marker go round from its top left; ahead is its right.
                # Up in the picture is x, left is y; pixels count from the middle of the first.
                right, down = corners[0].mean(axis=0)
                ahead = corners[0][1:3].mean(axis=0) - corners[0][[0, 3]].mean(axis=0)
                x, y = ((height - 1) / 2 - down) * metres, ((width - 1) / 2 - right) * metres
                self.poses[number].publish(
                    Pose2D(x=float(x), y=float(y), theta=math.atan2(-ahead[0], -ahead[1]))
                )


rclpy.init()
rclpy.spin(Feedback())
