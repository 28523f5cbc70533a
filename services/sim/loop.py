"""The loop: read commands, move, step, publish, at the pace of the clock."""

import math
import threading
import time

from holozen.bus import Bus
from holozen.messages import Clock, Time
from holozen.transport.pubsub import Publisher

from .entities import Entities
from .io.entity_services import EntityServices
from .io.topics import Schedule
from .pace import Pace
from .physics.world import World

CLOCK_RATE = 50.0  # Hz of sim time
POLL = 0.02  # s; how often requests and commands are read while no step is due
GRAPH_POLL = 0.004  # s; how often the graph is searched for nodes that left
STALL = 0.1  # s without reading; commands may have waited this long
DISTRUST = 0.1  # s after a stall in which the network's buffers may still bring old commands


class Loop:
    """Runs one world with its entities at `rtf` times real time (0: as fast as it goes).

    `is_clock`: whether it publishes its time.
    """

    def __init__(
        self, bus: Bus, world: World, entities: Entities, rtf: float, services: EntityServices | None = None,
        is_clock: bool = True,
    ) -> None:  # fmt: skip
        self._world, self._entities, self._robots = world, entities, entities.robots
        self.pace = Pace(world.spec.step, rtf, time.monotonic())
        self.answers = [services.answer] if services else []  # called between steps
        self._served = self.graph_polled = 0.0
        self._more_wait = False  # whether requests were left unanswered
        self._clock: Publisher[Clock] | None = bus.publisher("clock", Clock) if is_clock else None
        self._clock_due = Schedule(CLOCK_RATE)
        self._last_read = self._before_stall = time.monotonic()
        self._trusted_from = 0.0

    def run(self, stop: threading.Event, steps: int | None = None) -> None:
        """Step until `stop` is set, or for a number of `steps`."""
        pace = self.pace
        pace.set_factor(pace.rtf, time.monotonic())
        last = None if steps is None else self._world.steps + steps
        while not stop.is_set() and self._world.steps != last:
            now = time.monotonic()
            self._read_inputs(now)
            if (left := pace.left(now)) > 0:
                stop.wait(min(left, 0.0 if self._more_wait else POLL))
            else:
                self._step(now)
                pace.stepped(now)

    def _read_inputs(self, now: float) -> None:
        if now - self._last_read > STALL:
            self._before_stall, self._trusted_from = self._last_read, now + DISTRUST
        since = self._last_read if now >= self._trusted_from else self._before_stall
        self._last_read = now
        clocks = (time.time(), self._world.time)
        for robot in self._robots:
            robot.read_commands(now, clocks, since)
        if now - self.graph_polled >= GRAPH_POLL:
            self._entities.watch_senders(now)  # after their last commands were read
            self.graph_polled = now
        if now - self._served >= POLL:
            self._more_wait = sum(answer() for answer in self.answers) > 0  # each of them answers
            self._served = -math.inf if self._more_wait else now

    def _step(self, now: float) -> None:
        world, dt = self._world, self._world.spec.step
        try:
            for robot in self._robots:
                if robot.has_to_move(now):
                    robot.move(now, dt)
            world.step()
            sim_time = world.time
            for robot in self._robots:
                if sim_time >= robot.publishes_at:
                    robot.publish(sim_time, dt)
        except (ArithmeticError, ValueError) as error:  # such as a position that became NaN
            self._entities.fail(robot, error)
        if self._clock and self._clock_due.due(world.time):
            self._clock.put(Clock(Time.of(world.time)))
