"""tf2_geometry_msgs: points, vectors and poses in another frame."""

from typing import Any

from holozen.ros import generated
from holozen.ros.tf2_buffer import TransformRegistration
from holozen.ros.tf2_math import Rigid, multiply, rotate

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
    there = _made("PointStamped", transform)
    there.point = _point(point.point, _rigid(transform))
    return there


def do_transform_vector3(vector3: Any, transform: Any) -> Any:
    """A Vector3Stamped in the frame of a TransformStamped: it is turned, and not moved."""
    there = _made("Vector3Stamped", transform)
    v = vector3.vector
    there.vector.x, there.vector.y, there.vector.z = rotate(_rigid(transform).rotation, (v.x, v.y, v.z))
    return there


def do_transform_pose(pose: Any, transform: Any) -> Any:
    """A Pose (not stamped) in the frame of a TransformStamped."""
    rigid = _rigid(transform)
    there: Any = generated.find("geometry_msgs/msg/Pose")()
    there.position = _point(pose.position, rigid)
    q, turned = pose.orientation, there.orientation
    turned.x, turned.y, turned.z, turned.w = multiply(rigid.rotation, (q.x, q.y, q.z, q.w))
    return there


def do_transform_pose_stamped(pose: Any, transform: Any) -> Any:
    """A PoseStamped in the frame of a TransformStamped."""
    there = _made("PoseStamped", transform)
    there.pose = do_transform_pose(pose.pose, transform)
    return there


def do_transform_pose_with_covariance_stamped(pose: Any, transform: Any) -> Any:
    """A PoseWithCovarianceStamped in the frame of a TransformStamped; its covariance is turned too."""
    there = _made("PoseWithCovarianceStamped", transform)
    there.pose.pose = do_transform_pose(pose.pose.pose, transform)
    there.pose.covariance = _turned(list(pose.pose.covariance), transform)
    return there


def transform_to_matrix(transform: Any) -> Any:
    """The 4x4 numpy matrix of a TransformStamped."""
    import numpy as np

    rigid, matrix = _rigid(transform), np.identity(4)
    for column, axis in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))):
        matrix[:3, column] = rotate(rigid.rotation, axis)
    matrix[:3, 3] = rigid.translation
    return matrix


def _rigid(transform: Any) -> Rigid:
    t, q = transform.transform.translation, transform.transform.rotation
    return Rigid((t.x, t.y, t.z), (q.x, q.y, q.z, q.w))


def _made(name: str, transform: Any) -> Any:
    """A stamped message with the header of the transform."""
    there: Any = generated.find(f"geometry_msgs/msg/{name}")()
    there.header.stamp, there.header.frame_id = transform.header.stamp, transform.header.frame_id
    return there


def _point(point: Any, rigid: Rigid) -> Any:
    there: Any = generated.find("geometry_msgs/msg/Point")()
    there.x, there.y, there.z = rigid.point((point.x, point.y, point.z))
    return there


def _turned(covariance: list[float], transform: Any) -> list[float]:
    """The 6x6 covariance, row by row, of what was turned: its place and its angles alike."""
    import numpy as np

    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = transform_to_matrix(transform)[:3, :3]
    turned: list[float] = (turn @ np.reshape(covariance, (6, 6)) @ turn.T).ravel().tolist()
    return turned


_registration = TransformRegistration()
for _name, _do in (
    ("PointStamped", do_transform_point),
    ("Vector3Stamped", do_transform_vector3),
    ("PoseStamped", do_transform_pose_stamped),
    ("PoseWithCovarianceStamped", do_transform_pose_with_covariance_stamped),
):
    _registration.add(generated.find(f"geometry_msgs/msg/{_name}"), _do)
