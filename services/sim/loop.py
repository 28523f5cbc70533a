"""The loop: hear, move, step, tell, at the pace of the clock."""

import threading
import time

from holozen.bus import Bus
from holozen.messages import Clock, Time
from holozen.publisher import Publisher

from .entities import Entities
from .entity_services import EntityServices
from .pace import Pace
from .reports import Schedule
from .world import World

CLOCK_RATE = 50.0  # Hz of sim time
LOOK = 0.02  # s; how often requests and commands are heard while no step is due
GRAPH = 0.004  # s; how often one looks who left
STALL = 0.1  # s without hearing; commands may have waited as long
DISTRUST = 0.1  # s after a stall in which the network's buffers may still bring old commands


class Loop:
    """Runs one world with its entities at `rtf` times real time (0: as fast as it goes)."""

    def __init__(
        self, bus: Bus, world: World, entities: Entities, rtf: float, services: EntityServices | None = None
    ) -> None:
        self._world, self._entities, self._vehicles = world, entities, entities.vehicles
        self.pace = Pace(world.spec.step, rtf, time.monotonic())
        self.answers = [services.answer] if services else []  # called between steps, to answer requests
        self._served = self._looked = 0.0
        self._clock: Publisher[Clock] = bus.publisher("clock", Clock)
        self._clock_due = Schedule(CLOCK_RATE)
        self._heard = self._before_stall = time.monotonic()
        self._trusts_from = 0.0

    def run(self, stop: threading.Event, steps: int | None = None) -> None:
        """Step until `stop` is set, or `steps` were made."""
        pace = self.pace
        pace.keep(pace.rtf, time.monotonic())
        last = None if steps is None else self._world.steps + steps
        while not stop.is_set() and self._world.steps != last:
            now = time.monotonic()
            self._hear(now)
            if (left := pace.left(now)) > 0:
                stop.wait(min(left, LOOK))
            else:
                self._step(now)
                pace.stepped(now)

    def _hear(self, now: float) -> None:
        if now - self._heard > STALL:
            self._before_stall, self._trusts_from = self._heard, now + DISTRUST
        since = self._heard if now >= self._trusts_from else self._before_stall
        self._heard = now
        clocks = (time.time(), self._world.time)
        for vehicle in self._vehicles:
            vehicle.hear(now, clocks, since)
        if now - self._looked >= GRAPH:
            self._entities.hear_who_left()  # after all that they said
            self._looked = now
        if now - self._served >= LOOK:
            for answer in self.answers:
                answer()
            self._served = now

    def _step(self, now: float) -> None:
        world, dt = self._world, self._world.spec.step
        try:
            for vehicle in self._vehicles:
                vehicle.move(now, dt)
            world.step()
            for vehicle in self._vehicles:
                vehicle.tell(world.time, dt)
        except (ArithmeticError, ValueError) as error:  # a position that is no number any more, say
            self._entities.fail(vehicle, error)
        if self._clock_due.due(world.time):
            self._clock.put(Clock(Time.of(world.time)))
