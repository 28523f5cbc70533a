"""The loop: read commands, move, step and publish, paced by the clock, or for as many steps as were requested."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable

from holozen.bus import Bus
from holozen.command.wait_set import Moment, ReadTimes
from holozen.console import report
from holozen.messages import Clock, SimulationStatus, Time

from .entities import Entities
from .physics.world import World
from .robot import Robot
from .schedule import Pace, Schedule
from .simulation import Simulation

CLOCK_RATE = 50.0  # Hz of sim time
STATUS_RATE = 10.0  # Hz of real time
PAUSED_RATE = 20.0  # Hz of real time, at which a paused world is published, so that no reader takes it for lost
MEASURED = 1.0  # s of real time over which the real-time factor is measured
REPORT_EVERY = 60.0  # s between two reports of overruns
POLL = 0.02  # s; the longest time between two readings of requests, and of commands while no step is due
SHARE = 0.25  # of the time since the last request, after which requests are read again: one often follows another
READ_EVERY = 0.003  # s between two readings of commands and stops, and of nodes that left, however short the steps
FAULTS = (ArithmeticError, ValueError)  # of a body whose position became NaN


class Loop:
    """Runs one world with its entities at `rtf` times real time (0: as fast as possible). With `is_clock` it publishes
    its time. The `answers` are called between steps, and return whether they answered a request.
    """

    def __init__(self, bus: Bus, world: World, entities: Entities, rtf: float, is_clock: bool = True) -> None:
        self._bus, self._world, self._entities, self._robots = bus, world, entities, entities.robots
        self.pace = Pace(world.spec.step, rtf, time.monotonic())
        self.answers: list[Callable[[], bool]] = []
        self._served = self._polled = 0.0
        self._answered_at = -math.inf  # s; the last time that a request was answered
        self._clock = bus.publisher("clock", Clock) if is_clock else None
        self._clock_due = Schedule(CLOCK_RATE)
        self._status = bus.publisher("simulation_status", SimulationStatus) if is_clock else None
        self._status_at = self._shown_at = self._reported_at = -math.inf
        self._reported = 0  # overruns
        self._marks: deque[tuple[float, float]] = deque()  # real and sim time of past statuses
        self.simulation = Simulation(world, entities, self.pace, self.publish_all)
        self._reads = ReadTimes(time.monotonic())
        self._reads_at = 0.0

    def run(self, stop: threading.Event, steps: int | None = None) -> None:
        """Step until `stop` is set, or for a number of `steps`."""
        pace = self.pace
        pace.set_factor(pace.rtf, time.monotonic())
        last = None if steps is None else self._world.steps + steps
        self._reads_at = 0.0
        while not stop.is_set() and self._world.steps != last:
            now = time.monotonic()
            self._read_inputs(now)
            if now >= self._status_at:
                self._publish_status(now)
            if self.simulation.is_paused:
                self._step_on_request(now, stop)
            elif (left := pace.left(now)) > 0:
                stop.wait(min(left, self._until_served(now)))
            else:
                self._step(now)
                pace.stepped(now)

    def _step_on_request(self, now: float, stop: threading.Event) -> None:
        """While paused: make the next requested step once all earlier commands have been read and dated."""
        steps = self.simulation.steps
        if steps and steps.may_begin and not any(robot.is_waiting for robot in self._robots):
            self._step(now)
            self.simulation.stepped()
        elif now >= self._shown_at:
            self.publish_all()
            self._shown_at = now + 1 / PAUSED_RATE
        else:
            stop.wait(self._until_served(now))

    def _until_served(self, now: float) -> float:
        """The time in s until requests are read again. It is 0 right after one was answered, as more may wait."""
        return min(SHARE * (now - self._answered_at), POLL)

    def publish_all(self) -> None:
        """Publish the present state of everything."""
        failed: dict[Robot, Exception] = {}
        for robot in list(self._robots):
            try:
                robot.publish(self._world.time, self._world.spec.step, at_once=True)
            except FAULTS as error:
                failed[robot] = error
        self._send(failed)
        if self._clock:
            self._clock.put(Clock(Time.of(self._world.time)))
        self._publish_status(time.monotonic())

    def _send(self, failed: dict[Robot, Exception]) -> None:
        """Send what robots have queued, and only then take out those that failed, with their publishers."""
        self._bus.send_queued()
        for robot, why in failed.items():
            if robot in self._robots:
                self._entities.fail(robot, why)

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
        self._status_at = now + 1 / STATUS_RATE
        if self._status:
            self._status.put(
                SimulationStatus(
                    simulation.state, sim_time, self._world.steps, self._world.spec.step, simulation.epoch, factor,
                    pace.rtf, pace.overruns, pace.lost,
                )
            )  # fmt: skip
        if pace.overruns > self._reported and now - self._reported_at >= REPORT_EVERY:
            overruns = f"{pace.overruns} overrun{'' if pace.overruns == 1 else 's'}"
            report(f"sim: {overruns}, {pace.lost:.1f} s lost; running at {factor:.2f}x real time")
            self._reported, self._reported_at = pace.overruns, now

    def _read_inputs(self, now: float) -> None:
        if now < self._reads_at:
            return
        steps = self.simulation.steps
        is_asked = steps is not None and not steps.may_begin
        since = self._reads.since(now)
        moment = Moment(now, since, (time.time(), self._world.time))
        self._entities.commands.read(moment)
        statuses = self._entities.agenda.statuses
        for robot in statuses.due(now):
            robot.publish_status(now)
            statuses.set(robot, now + 1 / STATUS_RATE)
        self._entities.watch_senders(moment)  # after their last commands were read
        if is_asked or now - self._polled >= POLL:
            self._entities.requests.read(moment._replace(since=min(since, self._polled or since)))
            self._polled = now
        if steps:
            steps.may_begin = True  # all commands sent before the request have been read
        if now - self._served >= self._until_served(now):
            if sum(answer() for answer in self.answers):  # calls them all, unlike any()
                self._answered_at = now
            self._served = now
        self._reads_at = now + min(READ_EVERY, self._until_served(now))

    def _step(self, now: float) -> None:
        world, dt, agenda = self._world, self._world.spec.step, self._entities.agenda
        failed: dict[Robot, Exception] = {}
        agenda.active.update(dict.fromkeys(agenda.moves.due(now)))
        for robot in list(agenda.active):
            try:
                robot.move(now, dt)
            except FAULTS as error:
                failed[robot] = error
            if robot.body.glides and robot.arbiter.due > now:  # it goes on as commanded until then
                del agenda.active[robot]
                agenda.moves.set(robot, robot.arbiter.due)
        try:
            world.step()
        except FAULTS as error:
            self._entities.remove_lost(error)
        for robot in agenda.publishes.due(world.time):
            try:
                robot.publish(world.time, dt)
            except FAULTS as error:
                failed[robot] = error
        self._send(failed)
        if self._clock and self._clock_due.due(world.time):
            self._clock.put(Clock(Time.of(world.time)))
