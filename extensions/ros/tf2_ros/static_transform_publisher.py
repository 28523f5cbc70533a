"""tf2_ros's static_transform_publisher: publishes one transform that never changes, until it is
terminated.

`python -m holozen run FILE` runs it, as `holozen launch` does for a launch file that contains it.
"""

import argparse
import contextlib
import sys
from collections.abc import Sequence
from typing import Any

from holozen.flags import Parser, number
from holozen.ros import rclpy
from holozen.ros.rclpy.context import ExternalShutdownException
from holozen.ros.rclpy.node import Node
from holozen.ros.tf2_ros.buffer import message_of
from holozen.ros.tf2_ros.transform_broadcaster import StaticTransformBroadcaster
from holozen.rotation import Transform, from_rpy, normalize

PARTS = ("x", "y", "z", "qx", "qy", "qz", "qw", "roll", "pitch", "yaw")
ANGLES, QUATERNION = ("x", "y", "z", "yaw", "pitch", "roll"), PARTS[:7]
FRAMES = ("frame-id", "child-frame-id")
LARGEST = 1e9  # m or rad


def read(words: Sequence[str]) -> argparse.Namespace:
    """The numbers and frames of a command line, as flags or in ROS's older form without flags; and
    their `rotation`.

    Angles (rad) take precedence over the quaternion, which may have any length but zero. Exits with
    code 2 for a mistake.
    """
    if len(words) in (8, 9) and not any(word.startswith("--") for word in words):
        names = (ANGLES if len(words) == 8 else QUATERNION) + FRAMES
        words = [f"--{name}={word}" for name, word in zip(names, words, strict=True)]
    parser = Parser(prog="static_transform_publisher")
    for name in PARTS:
        parser.add_argument(
            f"--{name}", type=number(-LARGEST, LARGEST), default=1.0 if name == "qw" else 0.0
        )
    for name in FRAMES:
        parser.add_argument(f"--{name}", required=True)
    args = parser.parse_args(words)
    angles = args.roll, args.pitch, args.yaw
    try:
        args.rotation = (
            from_rpy(*angles) if any(angles) else normalize((args.qx, args.qy, args.qz, args.qw))
        )
    except ValueError as error:
        parser.error(str(error))
    return args


def transform(args: argparse.Namespace) -> Any:
    """The TransformStamped of the arguments."""
    return message_of(
        args.frame_id, args.child_frame_id, 0, Transform((args.x, args.y, args.z), args.rotation)
    )


def main() -> None:
    rclpy.init()
    args = read(rclpy.remove_ros_args(sys.argv)[1:])
    node = Node(f"static_transform_publisher_{args.child_frame_id.strip('/').replace('/', '_')}")
    message = transform(args)
    message.header.stamp = node.get_clock().now().to_msg()
    broadcaster = StaticTransformBroadcaster(node)
    broadcaster.sendTransform(message)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main()
