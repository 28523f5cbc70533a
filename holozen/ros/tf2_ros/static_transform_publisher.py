"""tf2_ros's static_transform_publisher: publishes one transform that never changes, until it is terminated.

`python -m holozen run FILE` runs it, as `holozen launch` does for a launch file that contains it.
"""

import argparse
import contextlib
import sys
from collections.abc import Sequence
from typing import Any

from holozen.flags import Parser
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy.context import ExternalShutdownException
from holozen.ros.rclpy.node import Node
from holozen.ros.tf2_ros.transform_broadcaster import StaticTransformBroadcaster
from holozen.ros.tf_transformations import quaternion_from_euler

PARTS = ("x", "y", "z", "qx", "qy", "qz", "qw", "roll", "pitch", "yaw")
ANGLES, QUATERNION = ("x", "y", "z", "yaw", "pitch", "roll"), PARTS[:7]
FRAMES = ("frame-id", "child-frame-id")


def parser() -> argparse.ArgumentParser:
    parser = Parser(prog="static_transform_publisher")
    for name in PARTS:
        parser.add_argument(f"--{name}", type=float, default=1.0 if name == "qw" else 0.0)
    for name in FRAMES:
        parser.add_argument(f"--{name}", required=True)
    return parser


def read(words: Sequence[str]) -> argparse.Namespace:
    """The numbers and frames of a command line: as flags, or in ROS's older form without flags."""
    if len(words) in (8, 9) and not any(word.startswith("--") for word in words):
        names = (ANGLES if len(words) == 8 else QUATERNION) + FRAMES
        words = [f"--{name}={word}" for name, word in zip(names, words, strict=True)]
    joined: list[str] = []
    for word in words:  # argparse would take -1e-3 as a flag
        is_value = bool(joined) and joined[-1].removeprefix("--") in PARTS
        joined[-1:] = [f"{joined[-1]}={word}"] if is_value else [*joined[-1:], word]
    return parser().parse_args(joined)


def transform(args: argparse.Namespace) -> Any:
    """The TransformStamped of the arguments. Angles take precedence over the quaternion."""
    message: Any = find("geometry_msgs/msg/TransformStamped")()
    message.header.frame_id, message.child_frame_id = args.frame_id, args.child_frame_id
    angles = args.roll, args.pitch, args.yaw
    x, y, z, w = quaternion_from_euler(*angles) if any(angles) else (args.qx, args.qy, args.qz, args.qw)
    t, q = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = args.x, args.y, args.z
    q.x, q.y, q.z, q.w = x, y, z, w
    return message


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
