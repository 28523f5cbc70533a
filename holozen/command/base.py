"""A robot's base on the wire, for a process that drives real wheels."""

import math
import time
from pathlib import Path

from holozen.bus import Bus, BusError
from holozen.command import ears
from holozen.command.arbiter import Arbiter
from holozen.command.collision_monitor import CollisionMonitor
from holozen.command.guard import Guard
from holozen.command.inputs import MAX_ANGULAR, MAX_LINEAR, TwistInput
from holozen.command.local_stop import LocalStops, Served
from holozen.command.motion import is_stop
from holozen.command.senders import LiveSenders
from holozen.command.stop_files import StopFiles, default_folder
from holozen.command.stop_services import RobotServices
from holozen.command.wait_set import Moment, ReadTimes, WaitSet
from holozen.console import report
from holozen.kinematics import travelled
from holozen.limits import Planar
from holozen.messages import (
    CommandStatus,
    Header,
    LaserScan,
    Odometry,
    Range,
    TFMessage,
    Time,
    Twist,
    TwistStamped,
)
from holozen.odometry import odometry, transform
from holozen.rotation import from_axis_angle
from holozen.transport.graph import Endpoint, on_key
from holozen.transport.pubsub import Subscription
from holozen.wire import COMMAND_SILENCE, MAX_COMMAND_BYTES, key_for, release_command, robot_name

STATUS_EVERY = 0.1  # s
MAX_SCAN = 500_000  # bytes; 10,000 ranges as text take some 200,000
PATIENCE = 0.5  # s for the nodes that are there to be discovered
TAKEN = "{robot} is served by {by} already: end that one, or give this one another name"


class Base:
    """Obeys `cmd_vel` by the same rules as the sim's robots: watchdog, age, priorities, limits,
    stop, release, resume.

    Call `velocity` at least 20 times a second, drive the wheels at that velocity, and call
    `publish` with what they measured. While the loop is held up, or once it has ended in any way,
    the wheels keep turning: give it a `guard`, which stops them then, or make the hardware stop by
    itself without commands.

    It obeys `holozen stop` of this machine without a network too, and stops itself while its
    session does not answer.

    A software stop is kept in a file in the folder `state`, by default HOLOZEN_STATE, else
    ~/.local/state/holozen: the next base of the same name on the same network is still stopped.
    Raises BusError if another process, a base or a sim, serves the robot already.

    A `monitor` slows it down towards what its sensors see: the keys of these, below the robot's
    name, carry LaserScan or Range. They are as old as their stamps say, without one as their
    arrival.

    `timeout` is the silence in s after which the robot stops, up to 2. Commands beyond the limits,
    in m/s and rad/s, are clamped. Raises ValueError for any other timeout, for a limit that is
    negative or not finite, and for what is no name of a robot. `bus` has to be a lasting one, so
    that other nodes discover its node.
    """

    def __init__(
        self,
        bus: Bus,
        robot: str = "",
        *,
        timeout: float = COMMAND_SILENCE,
        max_linear: float = MAX_LINEAR,
        max_angular: float = MAX_ANGULAR,
        frame: str = "odom",
        base_frame: str = "base_link",
        state: Path | str | None = None,
        guard: Guard | None = None,
        monitor: CollisionMonitor | None = None,
    ) -> None:
        if not 0 < timeout <= 2:
            raise ValueError(
                f"timeout is {timeout:g} s; a robot stops after 2 s of silence at the latest"
            )
        for name, limit, unit in (
            ("max_linear", max_linear, "m/s"),
            ("max_angular", max_angular, "rad/s"),
        ):
            if not 0 <= limit < math.inf:
                raise ValueError(f"{name} is {limit:g} {unit}; use 0 or more, such as 0.3")
        self._bus, self._robot = bus, robot and robot_name(robot)
        self._graph, self._is_member = bus.graph(), bus.member is not None
        self._graph.settled(bus.connected, max(PATIENCE, bus.took))
        odom, others = key_for("odom", robot), self._other_servers()
        if others := others or on_key(self._graph.endpoints(), odom, "pub"):
            raise self._taken(others[0])
        key, now = key_for("cmd_vel", robot), time.monotonic()
        self._beat = bus.beat()
        self._arbiter = Arbiter(timeout, robot=robot)
        senders = LiveSenders(self._graph, self._beat)
        self._input = TwistInput(key, self._arbiter, senders, max_linear, max_angular)
        self._arbiter.begin(now)
        self._input.on_news = self._publish_status
        commands: Subscription[Twist | TwistStamped] = bus.subscribe(
            key, Twist, TwistStamped, limit=MAX_COMMAND_BYTES, dealt=True
        )
        self._odom = bus.publisher(odom, Odometry)
        self._tf = bus.publisher(key_for("tf", robot), TFMessage)
        self._status = bus.publisher(f"{key}_status", CommandStatus)
        services = RobotServices(bus, key, (self._arbiter,), self._on_stop, bus.node)
        # the graph's changes when it was last scanned for rivals; None before
        self._scanned: int | None = None
        self._inputs = WaitSet()
        self._inputs.add([self._input.reader(commands), *services.stop, *services.others])
        self._reads, self._key, self._name = ReadTimes(now), key, robot or bus.node
        self._frames = key_for(frame, robot), key_for(base_frame, robot)
        self._pose, self._moved_at, self._status_due = (0.0, 0.0, 0.0), now, now
        folder = Path(state) if state else default_folder()
        self._stops = StopFiles(folder, bus.networks, bus.node) if folder else None
        if self._stops and (by := self._stops.read(robot)) is not None:
            self._arbiter.stop(by, now)
            self._stops.write(robot, by)
            still = f"{robot or 'the robot'} is still stopped by {by}"
            report(f"{bus.node}: {still}; `{release_command(robot)}` lets it drive again")
        self._guard, served, write = (
            guard,
            [Served(robot, self._name)],
            self._stops.write if self._stops else None,
        )
        self._local = bus.keep(
            LocalStops(
                bus.id,
                bus.networks,
                lambda: served,
                write,
                stands=guard is not None,
                reporter=bus.node,
            )
        )
        self._ears = bus.keep(ears.Ears(bus, bus.node, "it is stopped"))
        self._monitor, self._limited_at = monitor, now
        self._scans: dict[str, Subscription[LaserScan | Range]] = {
            name: bus.subscribe(key_for(name, robot), LaserScan, Range, depth=1, limit=MAX_SCAN)
            for name in (monitor.sensors if monitor else ())
        }

    def velocity(self) -> Planar:
        """The body-frame velocity (m/s, rad/s) to drive at; zeros while no source drives. Raises
        BusError if a base of the same name that was not discovered before has the lower session id:
        of the two, that one goes on. Raises GuardError if the guard is gone or hangs.
        """
        if self._guard:
            self._guard.beat()
        now = time.monotonic()
        moment = Moment(now, self._reads.since(now), (time.time(),))
        self._inputs.read(moment)
        for node in self._graph.left():
            self._inputs.read(moment)  # its last commands
            if self._input.freshness.is_session(node.source, node.session):
                self._arbiter.forget(node.source, self._is_member)
        if self._graph.changes != self._scanned:
            others, self._scanned = self._other_servers(), self._graph.seen
            if rival := next((one for one in others if one.session < self._bus.id), None):
                raise self._taken(rival)
        self._beat.poll()
        if now >= self._status_due:
            self._publish_status(now)
        now = time.monotonic()  # this process may have been suspended since
        self._stop_unasked(now)
        motion = self._arbiter.motion(now).value
        assert isinstance(motion, tuple), "only a velocity is offered"
        return self._near_obstacles(self._monitor, motion, now) if self._monitor else motion

    def _near_obstacles(self, monitor: CollisionMonitor, motion: Planar, now: float) -> Planar:
        """What of a velocity the monitor leaves."""
        for name, scans in self._scans.items():
            received = scans.try_recv()
            if received and received.message:
                stamp = received.message.header.stamp.seconds()
                monitor.see(name, received.message, time.time() - stamp if stamp else 0.0)
        passed, self._limited_at = now - self._limited_at, now
        return monitor.limit(motion, passed)

    def publish(self, measured: Planar) -> None:
        """Publish odometry and its transform. `measured` is the body-frame velocity (m/s, rad/s)
        since the last call. Raises ValueError for a number that is not finite.
        """
        if not all(map(math.isfinite, measured)):
            raise ValueError(f"the measured velocity {measured} is not finite")
        now = time.monotonic()
        (x, y, yaw), passed, self._moved_at = self._pose, now - self._moved_at, now
        dx, dy = travelled(measured, yaw, passed)
        self._pose = x, y, yaw = (
            x + dx,
            y + dy,
            math.remainder(yaw + measured[2] * passed, math.tau),
        )
        at, rotation = (x, y, 0.0), from_axis_angle((0.0, 0.0, 1.0), yaw)
        header = Header(Time.of(time.time()), self._frames[0])
        self._odom.put(odometry(header, self._frames[1], at, rotation, measured))
        self._tf.put(TFMessage([transform(header, self._frames[1], at, rotation)]))

    def _other_servers(self) -> list[Endpoint]:
        """The robot's service `stop` in other processes: each request would reach one of them
        only.
        """
        servers = on_key(self._graph.endpoints(), key_for("stop", self._robot), "srv")
        return [end for end in servers if end.session != self._bus.id]

    def _taken(self, other: Endpoint) -> BusError:
        return BusError(TAKEN.format(robot=self._robot or "the robot", by=other.source))

    def _stop_unasked(self, now: float) -> None:
        """Obey stops of this machine, and stop while none of the network may be heard."""
        for order in self._local.take():
            self._arbiter.stop(order.by, now)
            report(f"{self._bus.node}: {self._robot or 'the robot'} is stopped by {order.by}")
            order.message = self._keep_stop()
        is_deaf = self._ears.are_deaf(now, lambda: not is_stop(self._arbiter.motion(now).value))
        if is_deaf and not self._arbiter.stopped_by:
            self._arbiter.stop(ears.BY, now)
            self._keep_stop()

    def _on_stop(self, now: float) -> str:
        self._beat.send()
        self._publish_status(now)
        return self._keep_stop()

    def _keep_stop(self) -> str:
        return self._stops.write(self._robot, self._arbiter.stopped_by) if self._stops else ""

    def _publish_status(self, now: float) -> None:
        status = self._input.status(now)
        status.name, status.strafes = self._name, True
        status.max_linear, status.max_angular = self._input.linear, self._input.angular
        if self._monitor:
            status.time_before_collision = self._monitor.seconds
            status.limited = self._monitor.reason
        self._status.put(status)
        self._status_due = now + STATUS_EVERY
