"""Joins the mapper with the robots and their keys: publishes commands, hands over, switches between
robots.
"""

import time
from collections.abc import Iterable, Sequence

from holozen.bus import Bus
from holozen.messages import (
    CommandStatus,
    Header,
    Time,
    TriggerReply,
    TriggerRequest,
    Twist,
    TwistStamped,
)
from holozen.odometry import LOST, RobotFeedback
from holozen.transport.errors import ServiceError
from holozen.transport.graph import Endpoint, Graph, on_key
from holozen.transport.pubsub import Latest, Publisher
from holozen.wire import PRIORITY_OF, is_robot_name, key_for

from .control.layouts import FIXED
from .control.twist_mapper import TwistMapper
from .input.kitty import Event, Focus, Key, Unknown

FASTER = {"faster": 1.1, "slower": 0.9}  # a gamepad's buttons
STOP_RATE = 20.0  # Hz; a stop is repeated at least as often, however slow the commands are
RESUME_TIMEOUT = 0.2  # s; the keys wait while the sim is asked
UNSEEN = "the window lost focus: stopped"
BLIND = "odom was lost: stopped; press a key again to drive"
RESET = "the robot was reset: stopped; press a key again to drive"
WAITING = "waiting for the robot: nothing was heard from it yet"
SWITCHING = "switching to the next robot: press the key again"


class RobotClient:
    """A robot to drive. Its other keys are siblings of `command`, its command key; `stamped` is as
    for Session.
    """

    def __init__(self, bus: Bus, robot: str, command: str, stamped: str | None) -> None:
        self.robot, self.key = robot, command or key_for("cmd_vel", robot)
        self._stamped = stamped
        kind: type[Twist] | type[TwistStamped] = Twist if stamped is None else TwistStamped
        self._commands: Publisher[Twist | TwistStamped] = bus.publisher(
            self.key, kind, PRIORITY_OF["teleop"]
        )
        assert self._commands.echoes
        self._echoes = self._commands.echoes
        self._echoes.settle(0.0)  # a key waits for no beat
        self.status_key = f"{self.key}_status"
        self.name = ""  # in the sim; empty while it is not known
        self.strafes = True  # as it has said last
        self._status = bus.latest(self.status_key, CommandStatus)
        self.odom = RobotFeedback(bus, self.beside("odom"), self._status)

    def beside(self, name: str) -> str:
        """The robot's key with this name, beside its command key."""
        return key_for(name, self.key.rpartition("/")[0])

    def put(self, twist: Twist) -> None:
        """Publish a command."""
        if self._stamped is None:
            self._commands.put(twist)
        else:
            self._commands.put(TwistStamped(Header(Time.of(time.time()), self._stamped), twist))

    def hear(self) -> str:
        """Take the robot's beat. Returns why it cannot be driven yet; empty if it can."""
        return WAITING if self._echoes.awaited else ""

    def status(self) -> CommandStatus:
        """The sim's last command status; empty if it is outdated."""
        status, age = self._status.read()
        self.name = status.name if status else ""
        self.strafes = status.strafes if status else self.strafes
        return status if status and age < 3 * LOST else CommandStatus()

    def close(self) -> None:
        """Close its publishers and subscriptions."""
        self._commands.close()
        self.odom.close()
        self._status.close()


def robots_among(endpoints: Iterable[Endpoint]) -> set[str]:
    """The robots with a subscriber of commands; empty for the one at the root."""
    keys = {end.key for end in endpoints if end.kind == "sub"}
    robots = {
        key.removesuffix("cmd_vel").rstrip("/")
        for key in keys
        if key == "cmd_vel" or key.endswith("/cmd_vel")
    }
    # Anyone may declare any token.
    return {robot for robot in robots if not robot or is_robot_name(robot)}


class Session:
    """The teleop without its terminal. `stamped` is the frame_id of a TwistStamped, or None to
    publish Twist. `command` is the command key of the first robot, if it is not that robot's
    cmd_vel.
    """

    def __init__(
        self,
        bus: Bus,
        robots: Sequence[str],
        mapper: TwistMapper,
        stamped: str | None,
        command: str = "",
    ) -> None:
        self.mapper, self.bus, self._stamped = mapper, bus, stamped
        self._robots = list(robots)
        self._first, self._command = (
            self._robots[0] if robots else command.rpartition("/")[0],
            command,
        )
        self.client = self._client(self._first)
        self._root = (
            bus.latest("cmd_vel_status", CommandStatus) if any(robots) and not command else None
        )
        mapper.switch(self.client.robot)
        self.graph: Graph = bus.graph()
        self.sent: Twist | None = None
        self.warning = ""
        self.waiting = ""  # why the robot cannot be driven yet
        self.help = False
        self._had_odom = False  # at the last tick
        self.due = 0.0  # when the command is to be repeated
        # the action that waits until the robot is at rest: "resume" or "next_robot"
        self._pending: str | None = None

    def take(self, event: Event, now: float) -> str:
        """Take an event, and publish any change at once. Returns "quit" or "suspend" if it requests
        that.
        """
        if isinstance(event, Focus):
            return self.let_go(UNSEEN) if not event.gained and self.mapper.key_state.keys else ""
        if not isinstance(event, Key | Unknown):
            return ""
        key = event if isinstance(event, Key) else Key("unknown")
        if key.kind in ("press", "typed"):
            if self._is_switching() and FIXED.get(self.mapper.key(key)) not in ("quit", "suspend"):
                return self.let_go(SWITCHING)
            self.warning, self._pending = "", None
        return self.act(self.mapper.take(key, now), now)

    def disregard(self, key: Key, now: float) -> None:
        """Take a key that may have been pressed long ago: it moves nothing, and stops a moving
        robot.
        """
        self.mapper.disregard(key, now)
        if key.kind in ("press", "typed"):
            self.let_go()

    def act(self, action: str, now: float) -> str:
        """Do the action of a key or button, except "quit" and "suspend", which are returned for the
        caller to do.
        """
        if action in ("resume", "next_robot"):
            self.let_go()
            self._pending = action
        elif action == "help":
            self.help = not self.help
        elif action in FASTER:
            self.mapper.scale(FASTER[action])
        self.publish(now)
        return action if action in ("quit", "suspend") else ""

    def steer(self, stick: tuple[float, float, float], now: float) -> None:
        """Take the joystick's deflection (forward, left, counter-clockwise; -1 to 1), and publish
        any change.
        """
        if stick != self.mapper.stick:
            # as a key does: an operator who steers has not handed over
            if self._pending == "resume":
                self._pending = None
            self.mapper.steer(stick, now)
            self.publish(now)

    def tick(self, now: float) -> None:
        """Publish what is due: a stop if a key is no longer held, or the repeated command."""
        self.waiting = self.client.hear()
        if self._root:
            self._find_root(self._root)
        if self._pending and not self.mapper.engaged:
            self._do_pending()
        lost = self.client.odom.is_lost
        if (self.client.odom.poll_removed() or (lost and self._had_odom)) and self._drives:
            self.let_go(BLIND)
        self._had_odom = not lost
        if self.client.odom.poll_reset() and self._drives:
            self.let_go(RESET)
        repeats = self.mapper.settings.repeat_rate > 0 or self.mapper.stopping_since() is not None
        if self.mapper.expire(now) or (repeats and now >= self.due):
            self.publish(now)

    def let_go(self, why: str = "") -> str:
        """Release all keys, and publish a stop at once if this teleop moves the robot. `why` is
        shown.
        """
        if self._drives:
            now = time.monotonic()
            self.mapper.stop(now)
            self.publish(now)
        else:  # held keys may cancel out, and a stop in progress continues
            self.mapper.let_go()
        self.warning = why or self.warning
        return ""

    def halt(self) -> None:
        """Stop the robot if this teleop moves it: zeros until odom shows rest, at most a second."""
        self.let_go()
        while self.mapper.engaged:
            time.sleep(0.01)
            self.publish(time.monotonic())

    def publish(self, now: float) -> None:
        """Publish the mapper's command at `now`, if it has one."""
        since = self.mapper.stopping_since()
        self.sent = self.mapper.command(now, since is not None and self.client.odom.rests(since))
        rate = self.mapper.settings.repeat_rate
        self.due = now + 1 / (rate if rate and since is None else max(rate, STOP_RATE))
        if self.sent is not None:
            self.client.put(self.sent)

    def ring(self) -> list[str]:
        """The robots that Tab cycles through: those named, or else all with a command
        subscriber.
        """
        if len(self._robots) > 1:
            return self._robots
        there = robots_among(self.graph.endpoints())
        return sorted({*there, self.client.robot, *([self._first] if self._command else [])})

    def listeners(self) -> list[str]:
        """The nodes that subscribe to the commands."""
        return [end.node for end in on_key(self.graph.endpoints(), self.client.key, "sub")]

    @property
    def _drives(self) -> bool:
        return self.mapper.engaged and self.mapper.stopping_since() is None

    def _is_switching(self) -> bool:
        """Whether the switch still waits for this robot to rest: a key meant for the next one would
        move this one.
        """
        if self._pending == "next_robot" and not self.mapper.engaged:
            self._do_pending()
        return self._pending == "next_robot"

    def _do_pending(self) -> None:
        pending, self._pending = self._pending, None
        if pending == "resume":
            return self._hand_over()
        ring = self.ring()
        robot = ring[(ring.index(self.client.robot) + 1) % len(ring)]
        if robot == self.client.robot:
            self.warning = "there is no other robot"
        else:
            self._switch(robot)

    def _switch(self, robot: str) -> None:
        before, self.client, self.sent = self.client, self._client(robot), None
        before.close()
        self.mapper.switch(robot)

    def _find_root(self, root: Latest[CommandStatus]) -> None:
        """If a named robot has no keys, but the one at the root says that this is its name, drive
        that one.
        """
        status = root.read()[0]
        name = status.name if status else ""
        if (
            not name
            or name not in self._robots
            or self.mapper.engaged
            or on_key(self.graph.endpoints(), key_for("cmd_vel", name), "sub")
        ):
            return
        self._robots[self._robots.index(name)] = ""
        if self.client.robot == name:
            self._switch("")

    def _client(self, robot: str) -> RobotClient:
        return RobotClient(
            self.bus, robot, self._command if robot == self._first else "", self._stamped
        )

    def _hand_over(self) -> None:
        """Allow held sources to drive again."""
        try:
            key = self.client.beside("resume")
            self.warning = self.bus.call(
                key, TriggerRequest(), TriggerReply, RESUME_TIMEOUT
            ).message
        except ServiceError as error:
            self.warning = f"not handed over: {error}"
