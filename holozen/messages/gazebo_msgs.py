"""What Gazebo's bumper sends, and where everything in its world is."""

from msgspec import field

from holozen.messages.geometry_msgs import Pose, Twist, Vector3, Wrench
from holozen.messages.message import Message
from holozen.messages.std_msgs import Header


class ContactState(Message):
    """Where two parts touch: points in m, unit vectors out of the second into the first, and how
    deep in m. The parts are ENTITY::LINK.
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


class ModelStates(Message):
    """The poses and velocities of all models in the world frame, by their names."""

    name: list[str] = field(default_factory=list)
    pose: list[Pose] = field(default_factory=list)
    twist: list[Twist] = field(default_factory=list)


class LinkStates(Message):
    """The poses and velocities of the links of all models in the world frame. A name is
    MODEL::LINK.
    """

    name: list[str] = field(default_factory=list)
    pose: list[Pose] = field(default_factory=list)
    twist: list[Twist] = field(default_factory=list)
