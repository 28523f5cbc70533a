"""The keys that tell where everything is: `model_states` and `link_states`, as Gazebo publishes
them.
"""

import math

from holozen.bus import Bus
from holozen.messages import LinkStates, ModelStates, Pose, Twist, Vector3

from ..entities import Entities
from ..link_states import LinkState


class WorldStates:
    """Publishes the states of the entities of one sim. Nothing is calculated while no one reads
    them.
    """

    def __init__(self, bus: Bus, entities: Entities) -> None:
        self._entities = entities
        self._models = bus.publisher("model_states", ModelStates)
        self._links = bus.publisher("link_states", LinkStates)

    def publish(self) -> None:
        """Publish the present states, if anyone wants them."""
        if self._models.poll_wanted():
            states = {
                each.name: LinkState(*each.body.pose(), *each.body.twist())
                for each in self._entities
            }
            self._models.put(ModelStates(*_columns(states)))
        if self._links.poll_wanted():
            links = {
                f"{each.name}::{link}": state
                for each in self._entities
                for link, state in each.link_states().items()
            }
            self._links.put(LinkStates(*_columns(links)))


def _columns(states: dict[str, LinkState]) -> tuple[list[str], list[Pose], list[Twist]]:
    """Without those whose numbers are not finite: the sim is about to take them out."""
    states = {
        name: at for name, at in states.items() if all(math.isfinite(sum(part)) for part in at)
    }
    poses = [Pose.of(at.xyz, at.rotation) for at in states.values()]
    twists = [Twist(Vector3(*at.linear), Vector3(*at.angular)) for at in states.values()]
    return list(states), poses, twists
