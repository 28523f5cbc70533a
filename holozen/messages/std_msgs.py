"""The header of stamped messages."""

from msgspec import field

from holozen.messages.builtin_interfaces import Time
from holozen.messages.message import Message


class Header(Message):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""
