"""Stops that need no network: those of this machine, and the sim's own while it may not hear
any.
"""

from collections.abc import Callable

from holozen.bus import Bus
from holozen.command import ears
from holozen.command.local_stop import LocalStops
from holozen.console import report

from .fleet import Fleet

# s; the longest pass of a loop that keeps up; one that does not leaves Zenoh's threads no time
# either
PASS = 0.01


class Safeguards:
    """Call `poll` at each pass of the loop, before it steps. `write` keeps who stopped a robot, if
    it is kept.
    """

    def __init__(self, bus: Bus, fleet: Fleet, write: Callable[[str, str], object] | None) -> None:
        self._fleet = fleet
        self._local = bus.keep(
            LocalStops(bus.id, bus.networks, fleet.served, write, stands=True, reporter="sim")
        )
        self._ears = bus.keep(ears.Ears(bus, "sim", "its robots are stopped", PASS))

    def poll(self, now: float) -> None:
        """Stop what is to stand at `now` (s)."""
        for order in self._local.take():
            order.message = self._fleet.stops.stop(order.by, [one.robot for one in order.robots])
            for one in order.robots:
                report(f"sim: {one.robot or 'the robot'} is stopped by {order.by}")
        is_deaf = self._ears.are_deaf(now, lambda: self._fleet.are_moving(now))
        if is_deaf:  # also one that is spawned, or released, meanwhile
            self._fleet.stops.stop(ears.BY, self._fleet.not_stopped())
