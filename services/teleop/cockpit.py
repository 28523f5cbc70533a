"""Joins pilot and bus: publishes what the keys say, reads what the screen shows."""

import time

from holozen.bus import Bus, Publisher, ServiceError
from holozen.graph import on_key
from holozen.messages import (
    CommandStatus,
    Header,
    Odometry,
    Time,
    TriggerReply,
    TriggerRequest,
    Twist,
    TwistStamped,
)
from holozen.wire import PRIORITY_OF, key_for, topic

from .keymap import RESUME
from .pilot import Pilot
from .view import State

RESTS = 0.01  # m/s and rad/s; slower than this is standing
STALL = 0.25  # s without a tick; longer pauses make old keys of new ones
RESUME_TIMEOUT = 0.2  # s; the keys wait while the sim is asked


class Cockpit:
    """One robot's teleop without its screen. `stamped`: publish TwistStamped with this frame_id, else None."""

    def __init__(self, bus: Bus, robot: str, pilot: Pilot, stamped: str | None) -> None:
        row = topic("odom")
        assert row is not None
        self.pilot, self._bus, self._robot, self._stamped, self._silence = pilot, bus, robot, stamped, row.silence
        self._key = key_for("cmd_vel", robot)
        kind: type[Twist] | type[TwistStamped] = Twist if stamped is None else TwistStamped
        self._commands: Publisher[Twist | TwistStamped] = bus.publisher(self._key, kind, PRIORITY_OF["teleop"])
        self._odom = bus.latest(key_for("odom", robot), Odometry)
        self._status = bus.latest(key_for("cmd_vel_status", robot), CommandStatus)
        self._graph = bus.graph()
        self._due = 0.0
        self._sent: Twist | None = None
        self._note = ""
        self._ticked = time.monotonic()  # when the keys were last known to be live
        self._handing = False  # over to others, as soon as the robot rests

    def press(self, key: str) -> None:
        """Take a key, and publish at once what it changes."""
        self._note = ""
        now = time.monotonic()
        if now - self._ticked > STALL:  # it was typed while nothing was shown and nothing was sent
            return self.let_go()
        self._handing = key == RESUME
        if self._handing:
            return self.let_go()
        self.pilot.press(key, now)
        self._publish()

    def tick(self) -> None:
        """Publish what is due: a stop when the key timed out, else what is repeated."""
        now = self._ticked = time.monotonic()
        if self._handing and not self.pilot.engaged:
            self._hand_over()
        repeats = self.pilot.settings.repeat_rate > 0 or self.pilot.stopping_since() is not None
        if self.pilot.expire(now) or (repeats and now >= self._due):
            self._publish()

    def let_go(self) -> None:
        """Publish a stop at once, if this teleop moves the robot."""
        if self.pilot.engaged:
            self.pilot.stop(time.monotonic())
            self._publish()

    def halt(self) -> None:
        """Stop the robot if this teleop moves it: zeros until odom shows rest, at most a second."""
        self.let_go()
        while self.pilot.engaged:
            time.sleep(0.01)
            self._publish()

    def state(self) -> State:
        """What there is to show."""
        odom, age = self._odom.read()
        status = self._status.read()[0] or CommandStatus()
        twist = odom.twist.twist if odom else Twist()
        settings, sent = self.pilot.settings, self._sent
        return State(
            robot=self._robot,
            speed=settings.speed,
            turn=settings.turn,
            command=(sent.linear.x, sent.linear.y, sent.angular.z) if sent else None,
            measured=(twist.linear.x, twist.linear.y, twist.angular.z),
            odom_age=age,
            stale=age > self._odom.patience(self._silence),
            listeners=[endpoint.node for endpoint in on_key(self._graph.endpoints(), self._key, "sub")],
            obeyed=status.obeyed,
            held=status.held,
            source=self._bus.source,
            note=self._note,
        )

    def _publish(self) -> None:
        now = time.monotonic()
        self._sent = self.pilot.command(now, self._rests())
        self._due = now + 1 / (self.pilot.settings.repeat_rate or 20.0)
        if self._sent is not None and self._stamped is None:
            self._commands.put(self._sent)
        elif self._sent is not None:
            self._commands.put(TwistStamped(Header(Time.of(time.time()), self._stamped or ""), self._sent))

    def _rests(self) -> bool:
        """Whether odom, newer than the stop, shows a robot that stands."""
        since = self.pilot.stopping_since()
        odom, age = self._odom.read()
        if since is None or odom is None or time.monotonic() - age <= since:
            return False
        return odom.twist.twist.is_slow(RESTS)

    def _hand_over(self) -> None:
        """Tell the sim that overruled sources may drive again."""
        self._handing = False
        try:
            key = key_for("resume", self._robot)
            self._note = self._bus.call(key, TriggerRequest(), TriggerReply, RESUME_TIMEOUT).message
        except ServiceError as error:
            self._note = f"not handed over: {error}"
