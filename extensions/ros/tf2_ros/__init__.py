"""tf2_ros: transforms between frames, from the topics `tf` and `tf_static`."""

from holozen.ros.tf2_ros.buffer import Buffer, TransformRegistration, TypeException
from holozen.ros.tf2_ros.buffer_core import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)
from holozen.ros.tf2_ros.transform_broadcaster import (
    StaticTransformBroadcaster,
    TransformBroadcaster,
)
from holozen.ros.tf2_ros.transform_listener import TransformListener

__all__ = [
    "Buffer",
    "ConnectivityException",
    "ExtrapolationException",
    "InvalidArgumentException",
    "LookupException",
    "StaticTransformBroadcaster",
    "TimeoutException",
    "TransformBroadcaster",
    "TransformException",
    "TransformListener",
    "TransformRegistration",
    "TypeException",
]
