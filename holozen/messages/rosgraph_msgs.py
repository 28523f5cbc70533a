"""The sim's clock."""

from msgspec import field

from holozen.messages.builtin_interfaces import Time
from holozen.messages.message import Message


class Clock(Message):
    clock: Time = field(default_factory=Time)
