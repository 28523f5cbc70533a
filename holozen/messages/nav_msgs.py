"""Odometry and paths."""

from msgspec import field

from holozen.messages.geometry_msgs import PoseStamped, PoseWithCovariance, TwistWithCovariance
from holozen.messages.message import Message
from holozen.messages.std_msgs import Header


class Odometry(Message):
    """The pose of a robot in `header.frame_id`, and its twist in `child_frame_id`."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


class Path(Message):
    """Poses in the frame of `header`, in the order in which they are to be reached."""

    header: Header = field(default_factory=Header)
    poses: list[PoseStamped] = field(default_factory=list)
