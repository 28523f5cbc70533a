"""tf2_geometry_msgs: points, vectors and poses in another frame."""

from typing import Any

from holozen.ros.generated import find
from holozen.rotation import Transform, rotate

__all__ = [
    "do_transform_point",
    "do_transform_pose",
    "do_transform_pose_stamped",
    "do_transform_pose_with_covariance_stamped",
    "do_transform_vector3",
    "transform_to_matrix",
]


def do_transform_point(point: Any, transform: Any) -> Any:
    """A PointStamped in the frame of a TransformStamped."""
    there = _stamped("PointStamped", transform)
    p, there.point = point.point, find("geometry_msgs/msg/Point")()
    there.point.x, there.point.y, there.point.z = _transform(transform).apply((p.x, p.y, p.z))
    return there


def do_transform_vector3(vector3: Any, transform: Any) -> Any:
    """A Vector3Stamped in the frame of a TransformStamped: rotated, and not translated."""
    there = _stamped("Vector3Stamped", transform)
    v = vector3.vector
    there.vector.x, there.vector.y, there.vector.z = rotate(
        _transform(transform).rotation, (v.x, v.y, v.z)
    )
    return there


def do_transform_pose(pose: Any, transform: Any) -> Any:
    """A Pose (not stamped) in the frame of a TransformStamped."""
    there: Any = find("geometry_msgs/msg/Pose")()
    moved = _transform(transform) @ Transform.of(pose.position, pose.orientation)
    p, o = there.position, there.orientation
    (p.x, p.y, p.z), (o.x, o.y, o.z, o.w) = moved.translation, moved.rotation
    return there


def do_transform_pose_stamped(pose: Any, transform: Any) -> Any:
    """A PoseStamped in the frame of a TransformStamped."""
    there = _stamped("PoseStamped", transform)
    there.pose = do_transform_pose(pose.pose, transform)
    return there


def do_transform_pose_with_covariance_stamped(pose: Any, transform: Any) -> Any:
    """A PoseWithCovarianceStamped in the frame of a TransformStamped; its covariance is rotated
    too.
    """
    there = _stamped("PoseWithCovarianceStamped", transform)
    there.pose.pose = do_transform_pose(pose.pose.pose, transform)
    there.pose.covariance = _rotated(list(pose.pose.covariance), transform)
    return there


def transform_to_matrix(transform: Any) -> Any:
    """The 4x4 numpy matrix of a TransformStamped."""
    import numpy as np

    rigid, matrix = _transform(transform), np.identity(4)
    for column, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
        matrix[:3, column] = rotate(rigid.rotation, axis)
    matrix[:3, 3] = rigid.translation
    return matrix


def _transform(transform: Any) -> Transform:
    return Transform.of(transform.transform.translation, transform.transform.rotation)


def _stamped(name: str, transform: Any) -> Any:
    """A stamped message with the header of the transform."""
    there: Any = find(f"geometry_msgs/msg/{name}")()
    there.header.stamp, there.header.frame_id = transform.header.stamp, transform.header.frame_id
    return there


def _rotated(covariance: list[float], transform: Any) -> list[float]:
    """A 6x6 covariance, row by row, with the position and the angles rotated."""
    import numpy as np

    rotation = np.zeros((6, 6))
    rotation[:3, :3] = rotation[3:, 3:] = transform_to_matrix(transform)[:3, :3]
    rotated: list[float] = (rotation @ np.reshape(covariance, (6, 6)) @ rotation.T).ravel().tolist()
    return rotated
