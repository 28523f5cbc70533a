"""Transforms between frames."""

from msgspec import field

from holozen.messages.geometry_msgs import TransformStamped
from holozen.messages.message import Message


class TFMessage(Message):
    transforms: list[TransformStamped] = field(default_factory=list)
