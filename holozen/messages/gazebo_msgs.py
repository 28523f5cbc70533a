"""What Gazebo's bumper sends."""

from msgspec import field

from holozen.messages.geometry_msgs import Vector3, Wrench
from holozen.messages.message import Message
from holozen.messages.std_msgs import Header


class ContactState(Message):
    """Where two parts touch: points in m, unit vectors out of the second into the first, and how deep in m. The parts
    are ENTITY::LINK.
    """

    info: str = ""
    collision1_name: str = ""
    collision2_name: str = ""
    wrenches: list[Wrench] = field(default_factory=list)
    total_wrench: Wrench = field(default_factory=Wrench)
    contact_positions: list[Vector3] = field(default_factory=list)
    contact_normals: list[Vector3] = field(default_factory=list)
    depths: list[float] = field(default_factory=list)


class ContactsState(Message):
    """All contacts of a part."""

    header: Header = field(default_factory=Header)
    states: list[ContactState] = field(default_factory=list)
