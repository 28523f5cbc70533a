"""Of two sims that start in the same instant, one goes on."""

import threading
from contextlib import closing
from functools import partial

from holozen.robot.model import WorldSpec
from holozen.testing import Wire, wait_for
from services.sim.__main__ import Rivals
from services.sim.entities import Entities
from services.sim.io.entity_services import EntityServices
from services.sim.physics.world import World


def test_of_two_sims_that_start_at_once_the_one_with_the_lower_session_goes_on(wire: Wire) -> None:
    with closing(World(WorldSpec())) as world:
        found = []
        for bus in (wire.bus("sim"), wire.bus("sim")):
            entities, stop = Entities(bus, world, (5.0, 10.0)), threading.Event()
            services = EntityServices(bus, entities, {})
            found.append((bus.id, entities, Rivals(entities, bus.id, stop), stop, services))
        for _, entities, *_ in found:
            wait_for(partial(entities.others_on, "spawn_entity", "srv"))
        for _, _, rivals, *_ in found:
            rivals.answer()
    (_, _, first, goes_on, _), (_, _, second, ends, _) = sorted(found, key=lambda one: one[0])
    assert (first.first, goes_on.is_set(), ends.is_set()) == ("", False, True)
    assert second.first.startswith("sim@")
