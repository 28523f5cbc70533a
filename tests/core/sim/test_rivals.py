"""Of two sims on the same keys one goes on, no matter when they learn of each other."""

import threading
from contextlib import closing
from functools import partial

from holozen.messages import Clock
from holozen.robot.model import WorldSpec
from holozen.testing import Wire, wait_for
from services.sim.entities import Entities
from services.sim.io.entity_services import EntityServices
from services.sim.other_nodes import Rivals
from services.sim.physics.world import World


def test_of_two_sims_the_one_with_the_lower_session_goes_on_however_late_they_meet(
    wire: Wire,
) -> None:
    with closing(World(WorldSpec())) as world:
        found, kept = [], []
        for bus in (wire.bus("sim"), wire.bus("sim")):
            entities, stop = Entities(bus, world, (5.0, 10.0)), threading.Event()
            rivals = Rivals(entities.others, stop)
            for _ in range(1000):  # each runs for long
                rivals.look()
            found.append((bus.id, entities, rivals, stop, bus))
        for _, entities, *_, bus in found:
            kept.append((EntityServices(bus, entities, {}), bus.publisher("clock", Clock)))
        for _, entities, *_ in found:
            wait_for(partial(entities.others.on, "spawn_entity", "srv"))
            wait_for(partial(entities.others.on, "clock", "pub"))
        for _, _, rivals, *_ in found:
            rivals.look()
    (_, _, first, goes_on, _), (_, _, second, ends, _) = sorted(found, key=lambda one: one[0])
    assert (first.winner, goes_on.is_set(), ends.is_set()) == (None, False, True)
    assert second.winner and second.winner.startswith("sim@")
