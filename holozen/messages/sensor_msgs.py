"""Joint states, which are joint commands too."""

from msgspec import field

from holozen.messages.message import Message
from holozen.messages.std_msgs import Header


class JointState(Message):
    """Joint angles in rad (or metres) and rates in rad/s (or m/s), in the order of `name`."""

    header: Header = field(default_factory=Header)
    name: list[str] = field(default_factory=list)
    position: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)
