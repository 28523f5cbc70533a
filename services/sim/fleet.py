"""The robots of a world on their keys: what they obey together, and when each is due."""

from collections.abc import Collection
from functools import partial

from holozen.bus import Bus
from holozen.command.local_stop import Served
from holozen.command.senders import LiveSenders
from holozen.command.wait_set import Moment, WaitSet
from holozen.transport.graph import Graph

from .commands import CommandRules
from .robot import Robot
from .schedule import Agenda
from .stop_memory import StopMemory

STATUS_RATE = 10.0  # Hz of real time
BURSTS = 4  # of telemetry in a period: Zenoh takes less time for many messages at once
FAULTS = (ArithmeticError, ValueError)  # of a body whose position became NaN

Faults = dict[Robot, Exception]
"""The robots that can no longer be simulated, each with the reason."""


class SenderWatch:
    """The nodes that may command the robots.

    Attributes:
        senders: What the robots know of them.
    """

    def __init__(self, bus: Bus, graph: Graph) -> None:
        self._graph = graph
        self._beat = bus.beat()
        self.senders = LiveSenders(graph, self._beat)

    def stop_left(self, robots: Collection[Robot], commands: WaitSet, moment: Moment) -> None:
        """Stop every robot whose driver's process is gone, once its last `commands` were read."""
        left = list(self._graph.left())
        if left:
            commands.read(moment)
        for node in left:
            for robot in robots:
                robot.commands.forget(node.source, node.session)

    def poll(self) -> None:
        """Let all senders hear that this process is there."""
        self._beat.poll()


class Fleet:
    """All robots of one world.

    Attributes:
        robots: In the order in which they were added.
        rules: What holds for the commands of all of them.
        stops: What the robots that come after them inherit.
    """

    def __init__(self, bus: Bus, graph: Graph, linear: float, angular: float) -> None:
        """Commands beyond `linear` (m/s) and `angular` (rad/s) are clamped."""
        self.robots: list[Robot] = []
        self._watch = SenderWatch(bus, graph)
        self.rules = CommandRules(self._watch.senders, linear, angular)
        self.stops = StopMemory()
        self._agenda: Agenda[Robot] = Agenda()
        self._commands, self._requests = WaitSet(), WaitSet()

    @property
    def next_phase(self) -> float:
        """The phase of the telemetry of the next robot."""
        return len(self.robots) % BURSTS / BURSTS

    def add(self, robot: Robot, now: float) -> None:
        """Add a robot at `now` (s): only commands move it that are sent from then on."""
        arbiters = robot.commands.arbiters
        living = [one.commands.arbiters for one in (*self.robots, robot)]
        self.stops.add(robot.identity.wire_name, arbiters, living)
        self.robots.append(robot)
        arbiters.begin(now)
        self.rules.senders.beat_now()
        robot.woken = partial(self._agenda.wake, robot)
        self._agenda.add(robot)
        self._commands.add(robot.commands.readers)
        self._requests.add(robot.commands.request_readers)

    def remove(self, robot: Robot) -> None:
        """Remove a robot, and close its keys."""
        self.robots.remove(robot)
        self._commands.remove(robot.commands.readers)
        self._requests.remove(robot.commands.request_readers)
        robot.woken = lambda: None
        self._agenda.forget(robot)
        robot.close()

    # Rules

    def limit(self, linear: float, angular: float) -> None:
        """Clamp commands to these limits, in m/s and rad/s, from the next one on."""
        self.rules.linear, self.rules.angular = linear, angular
        self._follow_rules()

    def limit_age(self, limit: float) -> None:
        """Refuse commands that may be older than `limit` seconds, except stops, from the next one
        on.
        """
        self.rules.max_age = limit
        self._follow_rules()

    def _follow_rules(self) -> None:
        for robot in self.robots:
            robot.commands.follow_rules()

    def set_odometry_rate(self, robot: Robot, rate: float) -> None:
        """Set the rate of a robot's odometry in Hz of sim time."""
        robot.telemetry.set_odometry_rate(rate)
        self._agenda.publishes.set(robot, 0.0)

    # Events

    def pause(self, now: float) -> None:
        """The sim is paused at `now` (s): commands age by its steps."""
        self.rules.time.pause(now)
        for robot in self.robots:
            self._agenda.wake(robot)

    def play(self, now: float) -> None:
        """The sim plays from `now` (s) on. Earlier commands no longer count, unless the robot's
        watchdog is off.
        """
        self.rules.time.play(now)
        for robot in self.robots:
            robot.commands.arbiters.begin(now, without_watchdog=False)
        self.rules.senders.beat_now()

    def reset(self) -> None:
        """The world was reset: only new commands move the robots, and what they publish is due at
        once.
        """
        for robot in self.robots:
            robot.reset()
            self._agenda.publishes.set(robot, 0.0)
        self.rules.senders.beat_now()

    # Stops

    def served(self) -> list[Served]:
        """The robots by their wire names. It is called in another thread too."""
        identities = [robot.identity for robot in list(self.robots)]
        return [Served(identity.wire_name, identity.name) for identity in identities]

    def not_stopped(self) -> list[str]:
        """The wire names of the robots whose software stop is not set."""
        names = (robot.identity.wire_name for robot in self.robots)
        return [name for name in names if not self.stops.is_stopped(name)]

    def stop_all(self, by: str) -> str:
        """Set the software stop of all robots. Returns why that is not kept for the next sim, or
        "".
        """
        return self.stops.stop(by, [robot.identity.wire_name for robot in self.robots])

    def are_moving(self, now: float) -> bool:
        """Whether any robot is commanded to move at `now` (s)."""
        return any(robot.commands.arbiters.are_moving(now) for robot in self.robots)

    # The loop

    def read_commands(self, moment: Moment) -> None:
        """Read what moves or stops the robots, and publish the statuses of their commands that are
        due.
        """
        self._commands.read(moment)
        for robot in self._agenda.statuses.take(moment.now):
            robot.publish_wanted_status(moment.now)
            self._agenda.statuses.set(robot, moment.now + 1 / STATUS_RATE)
        self._watch.stop_left(self.robots, self._commands, moment)
        self._watch.poll()

    def read_requests(self, moment: Moment) -> None:
        """Read all other requests to the robots."""
        self._requests.read(moment)

    def move(self, now: float, dt: float) -> Faults:
        """Apply the commands at `now` (s) to the next step of `dt` seconds, where they may have
        changed.
        """
        faults: Faults = {}
        for robot in self._agenda.take_moving(now):
            try:
                until = robot.move(now, dt)
            except FAULTS as error:
                faults[robot] = error
                continue
            if until > now and robot.body.glides:
                self._agenda.rest(robot, until)
        return faults

    def publish(self, time: float, dt: float) -> Faults:
        """Queue what is due at the sim time `time` after a step of `dt` seconds."""
        faults: Faults = {}
        for robot in self._agenda.publishes.take(time):
            try:
                self._agenda.publishes.set(robot, robot.telemetry.publish(time, dt))
            except FAULTS as error:
                faults[robot] = error
        return faults

    def publish_all(self, time: float, dt: float) -> Faults:
        """Queue the present state of all robots."""
        faults: Faults = {}
        for robot in self.robots:
            try:
                self._agenda.publishes.set(robot, robot.telemetry.publish_all(time, dt))
            except FAULTS as error:
                faults[robot] = error
        return faults
