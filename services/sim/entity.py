"""What is in the world: a robot or an object, by its name."""

import math
import time

from msgspec import Struct, field

from holozen.messages import Pose, SeenEntity
from holozen.robot.model import RobotModel

from .identity import Identity
from .link_states import LinkState, LinkStates, link_tree
from .physics.body import Body, Placement
from .robot import Robot


class Entity(Struct, eq=False):
    """A robot or object.

    Attributes:
        identity: What it is called, and its model.
        body: Its body in the engine.
        place: Where it was added.
        robot: What it is on the wire; None for an object without keys.
        number: What distinguishes it from all others that have had its name.
    """

    identity: Identity
    body: Body
    place: Placement
    robot: Robot | None = None
    number: int = field(default_factory=time.time_ns)

    @property
    def name(self) -> str:
        """Its name in the world."""
        return self.identity.name

    @property
    def model(self) -> RobotModel:
        """What it is made of."""
        return self.identity.model

    @property
    def is_finite(self) -> bool:
        """Whether its pose and velocity are finite."""
        return all(math.isfinite(sum(part)) for part in (*self.body.pose(), *self.body.twist()))

    def link_states(self) -> LinkStates:
        """The states of its links; for an object without joints they follow from its root, which is
        taken to stand.
        """
        if self.robot:
            return self.robot.link_states()
        return link_tree(self.model).states(LinkState(*self.body.pose()))

    def seen(self) -> SeenEntity:
        """What cameras see of it."""
        links = self.link_states()
        poses = [Pose.of(at.xyz, at.rotation) for at in links.values()]
        return SeenEntity(self.name, self.number, list(links), poses)
