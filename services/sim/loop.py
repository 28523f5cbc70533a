"""The loop: read commands, move, step and publish, paced by the clock, or for as many steps as were
requested.
"""

import threading
import time
from collections import deque
from collections.abc import Callable

from holozen.bus import Bus
from holozen.command.wait_set import Moment, ReadTimes
from holozen.console import report
from holozen.messages import Clock, SimulationStatus, Time

from .entities import Entities
from .fleet import FAULTS, Faults
from .io.world_states import WorldStates
from .physics.world import World
from .schedule import Pace, Schedule
from .simulation import Simulation

CLOCK_RATE = 50.0  # Hz of sim time
STATUS_RATE = 10.0  # Hz of real time
# Hz of real time, at which a paused world is published, so that no reader takes it for lost
PAUSED_RATE = 20.0
MEASURED = 1.0  # s of real time over which the real-time factor is measured
REPORT_EVERY = 60.0  # s between two reports of overruns
# s; the longest time between two readings of requests, and of commands while no step is due
POLL = 0.02
# requests come in bursts: poll again after this fraction of the time since the last one
BURST_SHARE = 0.25
# s between two readings of commands and stops, and of nodes that left, however short the steps
READ_EVERY = 0.003


class Loop:
    """Runs one world with its entities at `rtf` times real time (0: as fast as possible). With
    `is_clock` it publishes its time. The `answers` are called between steps, and return whether
    they answered a request. `engine` is what its status says of the engine.
    """

    def __init__(
        self,
        bus: Bus,
        world: World,
        entities: Entities,
        rtf: float,
        is_clock: bool = True,
        engine: str = "",
    ) -> None:
        self._bus, self._world, self._entities, self._fleet = bus, world, entities, entities.fleet
        self._engine = engine
        self.pace = Pace(world.spec.step, rtf, time.monotonic())
        self.answers: list[Callable[[], bool]] = []
        # called at each pass, and last before each step
        self.safeguard: Callable[[float], None] = lambda _now: None
        # s; when the `answers` were called, and when requests of robots were read, 0 before
        self._served_at = self._polled_at = 0.0
        self._answered_at: float | None = None  # s; the last time that a request was answered
        self._clock = bus.publisher("clock", Clock) if is_clock else None
        self._clock_due = Schedule(CLOCK_RATE)
        self._states = WorldStates(bus, entities)
        self._status = bus.publisher("simulation_status", SimulationStatus) if is_clock else None
        self._status_due = 0.0
        self._paused_world_due = 0.0
        self._report_due = 0.0
        self._reported = 0  # overruns
        self._marks: deque[tuple[float, float]] = deque()  # real and sim time of past statuses
        self.simulation = Simulation(world, entities, self.pace, self.publish_all)
        self._reads = ReadTimes(time.monotonic())
        self._read_due = 0.0

    def run(self, stop: threading.Event, steps: int | None = None) -> None:
        """Step until `stop` is set, or for a number of `steps`."""
        pace = self.pace
        pace.set_factor(pace.rtf, time.monotonic())
        last = None if steps is None else self._world.steps + steps
        self._read_due = 0.0
        while not stop.is_set() and self._world.steps != last:
            now = time.monotonic()
            self.safeguard(now)
            self._read_inputs(now)
            if now >= self._status_due:
                self._publish_status(now)
            if self.simulation.is_paused:
                self._step_on_request(now, stop)
            elif (left := pace.left(now)) > 0:
                stop.wait(min(left, self._until_served(now)))
            else:
                self._step(now)
                pace.stepped(now)

    def _step_on_request(self, now: float, stop: threading.Event) -> None:
        """While paused: make the next requested step once all earlier commands have been read."""
        steps = self.simulation.steps
        if steps and steps.may_begin:
            self._step(now)
            self.simulation.stepped()
        elif now >= self._paused_world_due:
            self.publish_all()
            self._paused_world_due = now + 1 / PAUSED_RATE
        else:
            stop.wait(self._until_served(now))

    def _until_served(self, now: float) -> float:
        """The time in s until requests are read again. It is 0 right after one was answered, as
        more may wait.
        """
        if self._answered_at is None:
            return POLL
        return min(BURST_SHARE * (now - self._answered_at), POLL)

    def publish_all(self) -> None:
        """Publish the present state of everything."""
        self._send(self._fleet.publish_all(self._world.time, self._world.spec.step))
        self._publish_world()
        self._publish_status(time.monotonic())

    def _send(self, faults: Faults) -> None:
        """Send what robots have queued, and only then remove those that failed, with their
        publishers.
        """
        self._bus.send_queued()
        for robot, why in faults.items():
            self._entities.remove_failed(robot, why)

    def _publish_world(self) -> None:
        self._states.publish()
        if self._clock:
            self._clock.put(Clock(Time.of(self._world.time)))

    def _publish_status(self, now: float) -> None:
        """Publish the simulation status, and report overruns."""
        sim_time, pace, simulation = self._world.time, self.pace, self.simulation
        if self._marks and sim_time < self._marks[-1][1]:
            self._marks.clear()
        self._marks.append((now, sim_time))
        while len(self._marks) > 1 and now - self._marks[1][0] >= MEASURED:
            self._marks.popleft()
        since, began = self._marks[0]
        factor = (sim_time - began) / (now - since) if now > since else 0.0
        self._status_due = now + 1 / STATUS_RATE
        if self._status:
            self._status.put(
                SimulationStatus(
                    simulation.state,
                    sim_time,
                    self._world.steps,
                    self._world.spec.step,
                    simulation.epoch,
                    factor,
                    pace.rtf,
                    pace.overruns,
                    pace.lost,
                    self._engine,
                )
            )
        if pace.overruns > self._reported and now >= self._report_due:
            overruns = f"{pace.overruns} overrun{'' if pace.overruns == 1 else 's'}"
            report(f"sim: {overruns}, {pace.lost:.1f} s lost; running at {factor:.2f}x real time")
            self._reported, self._report_due = pace.overruns, now + REPORT_EVERY

    def _read_inputs(self, now: float) -> None:
        if now < self._read_due:
            return
        steps = self.simulation.steps
        is_asked = steps is not None and not steps.may_begin
        since = self._reads.since(now)
        moment = Moment(now, since, (time.time(), self._world.time))
        self._fleet.read_commands(moment)
        if is_asked or now - self._polled_at >= POLL:
            self._fleet.read_requests(moment._replace(since=min(since, self._polled_at or since)))
            self._polled_at = now
        if steps:
            steps.may_begin = True  # all commands sent before the request have been read
        if now - self._served_at >= self._until_served(now):
            if sum(answer() for answer in self.answers):  # calls them all, unlike any()
                self._answered_at = now
            self._served_at = now
        self._read_due = now + min(READ_EVERY, self._until_served(now))

    def _step(self, now: float) -> None:
        world, dt = self._world, self._world.spec.step
        self.safeguard(now)  # again: Zenoh may have held up the reading of commands
        faults = self._fleet.move(now, dt)
        try:
            world.step()
        except FAULTS as error:
            self._entities.remove_lost(error)
        faults |= self._fleet.publish(world.time, dt)
        self._send(faults)
        if self._clock_due.advance(world.time):
            self._publish_world()
