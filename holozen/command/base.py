"""A robot's base on the wire, for a process that drives real wheels."""

import math
import time
from typing import Any

from holozen.bus import Bus
from holozen.command.arbiter import Arbiter
from holozen.command.inputs import MAX_ANGULAR, MAX_LINEAR, TwistInput
from holozen.command.stop_services import RobotServices
from holozen.command.time import Reads
from holozen.command.wait_set import Moment, Reader, WaitSet
from holozen.kinematics import travelled
from holozen.limits import Planar
from holozen.messages import (
    CommandStatus,
    Header,
    Odometry,
    Pose,
    PoseWithCovariance,
    Quaternion,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Twist,
    TwistStamped,
    TwistWithCovariance,
    Vector3,
)
from holozen.transport.pubsub import Subscription
from holozen.wire import COMMAND_SILENCE, MAX_COMMAND_BYTES, key_for

STATUS_EVERY = 0.1  # s


class Base:
    """Hears `cmd_vel` by the rules of the sim's robots: watchdog, age, priorities, limits, stop, release and resume.

    Call `velocity` 20 times a second or more, drive the wheels so, and call `publish` with what they have measured. A
    loop that is held up drives on blindly: let the hardware stop by itself when it hears nothing.

    `timeout` is the silence in s after which the robot stops; the limits are in m/s and rad/s, faster commands are
    clamped. `bus` has to be a lasting one, whose node others see.
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
    ) -> None:
        if not 0 < timeout <= 2:
            raise ValueError(f"timeout is {timeout:g} s; a robot stops after 2 s of silence at the latest")
        key, now = key_for("cmd_vel", robot), time.monotonic()
        self._graph, self._is_member = bus.graph(), bus.member is not None
        self._clocks = bus.peer_clocks(self._graph.has)
        self._arbiter = Arbiter(timeout)
        self._input = TwistInput(key, self._arbiter, self._clocks, max_linear, max_angular)
        self._commands: Subscription[Twist | TwistStamped] = bus.subscribe(
            key, Twist, TwistStamped, limit=MAX_COMMAND_BYTES
        )
        self._odom = bus.publisher(key_for("odom", robot), Odometry)
        self._tf = bus.publisher(key_for("tf", robot), TFMessage)
        self._status = bus.publisher(f"{key}_status", CommandStatus)
        services = RobotServices(bus, key, (self._arbiter,), self._publish_status, bus.node)
        self._inputs = WaitSet()
        self._inputs.add([Reader(self._commands.raw.channel, self._read), *services.stop, *services.others])
        self._reads, self._key, self._name = Reads(now), key, robot or bus.node
        self._frames = key_for(frame, robot), key_for(base_frame, robot)
        self._pose, self._moved_at, self._status_at = (0.0, 0.0, 0.0), now, -math.inf

    def velocity(self) -> Planar:
        """The body-frame velocity (m/s, rad/s) to drive at now; zeros while no source drives."""
        now = time.monotonic()
        moment = Moment(now, self._reads.since(now), (time.time(),))
        self._inputs.read(moment)
        for node in self._graph.left():
            self._inputs.read(moment)  # its last commands
            if self._input.freshness.is_session(node.source, node.session):
                self._arbiter.forget(node.source, self._is_member)
        self._clocks.track(set(self._graph.publishers(self._key)), now)
        self._clocks.poll(now)
        if now >= self._status_at or self._input.has_news:
            self._publish_status(now)
        motion = self._arbiter.motion(now)
        assert isinstance(motion, tuple), "only a velocity is offered"
        return motion

    def publish(self, measured: Planar) -> None:
        """Publish odometry and its transform: since the last call the robot has moved at the velocity `measured`, in
        the body frame. Raises ValueError for a number that is not finite.
        """
        if not all(map(math.isfinite, measured)):
            raise ValueError(f"the measured velocity {measured} is not finite")
        now = time.monotonic()
        (x, y, yaw), passed, self._moved_at = self._pose, now - self._moved_at, now
        dx, dy = travelled(measured, yaw, passed)
        self._pose = x, y, yaw = x + dx, y + dy, math.remainder(yaw + measured[2] * passed, math.tau)
        turned = Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        header = Header(Time.of(time.time()), self._frames[0])
        pose = Pose.of((x, y, 0.0), (turned.x, turned.y, turned.z, turned.w))
        self._odom.put(
            Odometry(header, self._frames[1], PoseWithCovariance(pose), TwistWithCovariance(Twist.planar(*measured)))
        )
        self._tf.put(TFMessage([TransformStamped(header, self._frames[1], Transform(Vector3(x, y, 0.0), turned))]))

    def _read(self, first: Any, moment: Moment) -> bool:
        self._input.take(self._commands.waiting(first), moment.now, moment.clocks, moment.since)
        return self._input.freshness.is_waiting

    def _publish_status(self, now: float) -> None:
        status = self._input.status(now)
        status.name, status.strafes = self._name, True
        status.max_linear, status.max_angular = self._input.linear, self._input.angular
        self._status.put(status)
        self._status_at = now + STATUS_EVERY
