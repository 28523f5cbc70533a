"""A robot as a test sees it: what it publishes, and a way to command it."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from holozen.bus import Bus
from holozen.messages import (
    CommandStatus,
    Message,
    Odometry,
    TriggerReply,
    TriggerRequest,
    Twist,
    TwistStamped,
)
from holozen.messages.rcl_interfaces import (
    Parameter,
    ParameterValue,
    SetParametersReply,
    SetParametersRequest,
)
from holozen.testing import wait_for
from holozen.testing.process import PATIENCE
from holozen.transport.graph import on_key
from holozen.transport.pubsub import Received, Subscription
from holozen.transport.samples import Sample
from holozen.wire import key_for

URDF = Path(__file__).parents[2] / "urdf"
RESTS = 1e-6  # m/s and rad/s
Planar = tuple[float, float, float]
"""x, y and yaw, in metres and radians; or their rates."""


class Record:
    """Everything that came on a key since this began, in order.

    What one key brings says nothing of what has come on another, and a message may come long after
    it was sent. So what a test asks for is of after a moment by the time of its sending: all
    processes of a test have one clock.
    """

    def __init__(self, subscription: Subscription[Any]) -> None:
        self._subscription = subscription
        self._received: list[Received[Any]] = []
        self._messages: list[Any] = []  # kept, since tests look every few milliseconds

    def all(self) -> list[Received[Any]]:
        began = time.monotonic()
        while (received := self._subscription.try_recv()) is not None:
            self._received.append(received)
            if received.message is not None:
                self._messages.append(received.message)
            if began < sent_at(received) < math.inf:
                break  # a sim that goes as fast as it can may publish more than this can read
        return self._received

    def messages(self) -> list[Any]:
        self.all()
        return self._messages

    def from_now(self) -> "Part":
        """What is sent from now on."""
        return Part(self)

    def next(
        self, wanted: Callable[[Any], object] = lambda _: True, within: float = PATIENCE
    ) -> Any:
        """The first message that is sent from now on and is as wanted; waits for it."""
        return self.from_now().next(wanted, within)


class Part:
    """What of a record was sent after this was made."""

    def __init__(self, record: Record) -> None:
        self._record, self._seen, self._began = record, len(record.all()), time.monotonic()
        self._found: list[Received[Any]] = []

    def all(self) -> list[Received[Any]]:
        new = self._record.all()[self._seen :]
        self._seen += len(new)
        self._found += [received for received in new if sent_at(received) > self._began]
        return self._found

    def messages(self) -> list[Any]:
        return [received.message for received in self.all() if received.message is not None]

    def next(
        self, wanted: Callable[[Any], object] = lambda _: True, within: float = PATIENCE
    ) -> Any:
        """The first message that is as wanted; waits for it."""
        looked = 0

        def look() -> Any:
            nonlocal looked
            new = self.all()[looked:]
            looked += len(new)
            return next(
                (r.message for r in new if r.message is not None and wanted(r.message)), None
            )

        return wait_for(look, within, "such a message")


def sent_at(received: Sample) -> float:
    """When it was sent, s as of time.monotonic; infinity for what a foreign program sent."""
    if not received.stamp or not received.timestamp:
        return math.inf
    return received.timestamp[0] * 1e-9 - (time.time() - time.monotonic())


def record(bus: Bus, key: str, *kinds: type[Message]) -> Record:
    return Record(bus.subscribe(key, *kinds, depth=50_000))


class Robot:
    """One robot: its odom, its status and the commands on its keys, and a publisher of commands."""

    def __init__(self, bus: Bus, name: str = "", priority: str = "DATA") -> None:
        self.bus, self.name = bus, name
        self.odom = record(bus, key_for("odom", name), Odometry)
        self.commands = record(bus, key_for("cmd_vel", name), Twist, TwistStamped)
        self._status = record(bus, key_for("cmd_vel_status", name), CommandStatus)
        self._publisher = bus.publisher(key_for("cmd_vel", name), Twist, priority)
        self.odom.next(within=60)  # its sim, and what starts that, may only just have begun

    def wait_longer(self, seconds: float = 2.0) -> "Robot":
        """Let it stop only after so much silence: a test that measures a drive may be held up.
        Itself.
        """
        timeout = Parameter(f"{self.name}.command_timeout".lstrip("."), ParameterValue.of(seconds))
        reported = self.bus.call(
            "sim/set_parameters", SetParametersRequest([timeout]), SetParametersReply
        )
        assert reported.results[0].successful, reported
        return self

    def newest(self) -> Odometry:
        """An odom published after this call."""
        odom: Odometry = self.odom.next()
        return odom

    def status(self) -> CommandStatus:
        """A status published after this call."""
        status: CommandStatus = self._status.next()
        return status

    def status_when(self, wanted: Callable[[CommandStatus], object]) -> CommandStatus:
        status: CommandStatus = self._status.next(wanted)
        return status

    def put(self, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> None:
        """One command."""
        self._publisher.put(Twist.planar(x, y, turn))

    def drive(
        self,
        x: float = 0.0,
        y: float = 0.0,
        turn: float = 0.0,
        until: Callable[[Odometry], object] | None = None,
    ) -> list[Odometry]:
        """Command with every odom, until one is as wanted (default: until the robot moves so).
        Returns them.
        """
        wanted = until or (lambda odom: moves(odom, x, y, turn))
        part, seen = self.odom.from_now(), 0
        self.put(x, y, turn)

        def look() -> bool:
            nonlocal seen
            new = part.messages()[seen:]
            seen += len(new)
            if new:
                self.put(x, y, turn)
            return any(wanted(odom) for odom in new)

        wait_for(
            look,
            what=lambda: f"the robot to be driven so; its status: {self._status.messages()[-1:]}",
        )
        odoms: list[Odometry] = part.messages()[:seen]
        return odoms

    def knows(self, node: str) -> None:
        """Wait for the link to a node that publishes commands: before that it may be heard by
        others, and not here.
        """
        key = key_for("cmd_vel", self.name)
        with self.bus.graph() as graph:
            wait_for(
                lambda: any(end.node == node for end in on_key(graph.endpoints(), key, "pub")),
                what=f"a link to {node}",
            )

    def stands(self) -> Odometry:
        """Wait until the robot rests; the odom that shows it."""
        odom: Odometry = self.odom.next(rests)
        return odom

    def wait_for_stop_command(self) -> None:
        """Wait until the last message on cmd_vel is a stop."""

        def stopped() -> bool:
            commands = self.commands.messages()
            return bool(commands) and not any(planar(commands[-1]))

        wait_for(stopped, what="a stop to be the last command")

    def stop(self) -> Odometry:
        self.put()
        return self.stands()

    def pass_time(self, seconds: float) -> Odometry:
        """Let that much sim time pass."""
        end = time_of(self.newest()) + seconds
        odom: Odometry = self.odom.next(
            lambda odom: time_of(odom) >= end, within=PATIENCE + 2 * seconds
        )
        return odom

    def resume(self) -> str:
        """Let everybody drive again. Raises ServiceError if the sim refuses."""
        return self.bus.call(key_for("resume", self.name), TriggerRequest(), TriggerReply).message

    def last_status(self) -> CommandStatus:
        """The newest status; waits for the first."""
        status: CommandStatus = wait_for(self._status.messages, what="a status")[-1]
        return status


def time_of(odom: Odometry) -> float:
    return odom.header.stamp.seconds()


def place(odom: Odometry) -> tuple[float, float, float]:
    """x, y in metres and yaw in radians."""
    return odom.pose.pose.planar()


def speeds(odom: Odometry) -> tuple[float, float, float]:
    twist = odom.twist.twist
    return twist.linear.x, twist.linear.y, twist.angular.z


def rests(odom: Odometry) -> bool:
    return max(map(abs, speeds(odom))) < RESTS


def moves(odom: Odometry, x: float, y: float, turn: float, tolerance: float = 1e-3) -> bool:
    """Whether the body-frame velocity is as given."""
    return all(abs(a - b) < tolerance for a, b in zip(speeds(odom), (x, y, turn), strict=True))


def distance(one: Odometry, other: Odometry) -> float:
    """Metres between two odoms, in the plane."""
    a, b = place(one), place(other)
    return math.hypot(a[0] - b[0], a[1] - b[1])


def planar(command: Twist | TwistStamped) -> tuple[float, float, float, float]:
    """A command as forward, left, up (m/s) and counter-clockwise (rad/s)."""
    twist = command.twist if isinstance(command, TwistStamped) else command
    return twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.z


def ahead(start: Planar, velocity: Planar, seconds: float) -> Planar:
    """Where a body is after moving at a constant body-frame velocity: straight, or on an arc."""
    x, y, yaw = start
    vx, vy, turn = velocity
    angle = turn * seconds
    if abs(turn) < 1e-12:
        forward, left = vx * seconds, vy * seconds
    else:
        sine, cosine = math.sin(angle) / turn, (1 - math.cos(angle)) / turn
        forward, left = vx * sine - vy * cosine, vx * cosine + vy * sine
    return (
        x + forward * math.cos(yaw) - left * math.sin(yaw),
        y + forward * math.sin(yaw) + left * math.cos(yaw),
        yaw + angle,
    )
