"""Joins pilot and robots: publishes what the keys say, hands over, goes from robot to robot."""

import time
from collections.abc import Sequence

from holozen.bus import Bus
from holozen.errors import ServiceError
from holozen.graph import Graph, on_key
from holozen.messages import TriggerReply, TriggerRequest, Twist

from .fixed_keys import FIXED
from .helm import Helm
from .keys import Event, Focus, Key, Unknown
from .pilot import Pilot

FASTER = {"faster": 1.1, "slower": 0.9}  # a gamepad's buttons
RESUME_TIMEOUT = 0.2  # s; the keys wait while the sim is asked
UNSEEN = "the window lost the focus: stopped"
BLIND = "odom comes no more: stopped; press a key again to drive"
ANEW = "the robot began anew: stopped; press a key again to drive"
ON_THE_WAY = "on the way to the next robot: press the key again"


class Cockpit:
    """The teleop without its terminal. `stamped`: publish TwistStamped with this frame_id, else None. `command`: where
    the first robot listens, if not at its own cmd_vel.
    """

    def __init__(self, bus: Bus, robots: Sequence[str], pilot: Pilot, stamped: str | None, command: str = "") -> None:
        self.pilot, self.bus, self._stamped = pilot, bus, stamped
        self._robots = list(robots)
        self._first, self._command = self._robots[0] if robots else command.rpartition("/")[0], command
        self.helm = self._helm(self._first)
        pilot.switch(self.helm.robot)
        self.graph: Graph = bus.graph()
        self.sent: Twist | None = None
        self.warning = ""
        self.help = False
        self._sees = False  # odom, when the robot was looked at last
        self.due = 0.0  # when a command is to be repeated
        self._wanted = ""  # what is done as soon as the robot rests: "resume" or "next_robot"

    def take(self, event: Event, now: float) -> str:
        """Take a key event, and publish at once what it changes. Returns "quit" or "suspend" where it asks for that."""
        if isinstance(event, Focus):
            return self.let_go(UNSEEN) if not event.gained and self.pilot.grip.keys else ""
        if not isinstance(event, Key | Unknown):
            return ""
        key = event if isinstance(event, Key) else Key("unknown")
        if key.kind == "press" or key.kind == "typed":
            if self._goes_on() and FIXED.get(key.name) not in ("quit", "suspend"):
                return self.let_go(ON_THE_WAY)
            self.warning, self._wanted = "", ""
        return self.act(self.pilot.take(key, now), now)

    def act(self, action: str, now: float) -> str:
        """Do what a key or a button asks for besides motion. Returns what is left to do, "quit" or "suspend"."""
        if action in ("resume", "next_robot"):
            self.let_go()
            self._wanted = action
        elif action == "help":
            self.help = not self.help
        elif action in FASTER:
            self.pilot.scale(FASTER[action])
        self.publish(now)
        return action if action in ("quit", "suspend") else ""

    def steer(self, stick: tuple[float, float, float], now: float) -> None:
        """Take the joystick's place (forward, left, counter-clockwise; -1 to 1), and publish what it changes."""
        if stick != self.pilot.stick:
            self.pilot.steer(stick, now)
            self.publish(now)

    def tick(self, now: float) -> None:
        """Publish what is due: a stop when a key is no longer held, else what is repeated."""
        if self._wanted and not self.pilot.engaged:
            self._do_wanted()
        lost = self.helm.lost()
        if lost and self._sees and self._drives:
            self.let_go(BLIND)
        self._sees = not lost
        if self.helm.began_anew() and self._drives:
            self.let_go(ANEW)
        repeats = self.pilot.settings.repeat_rate > 0 or self.pilot.stopping_since() is not None
        if self.pilot.expire(now) or (repeats and now >= self.due):
            self.publish(now)

    def let_go(self, why: str = "") -> str:
        """Let go of all keys, and publish a stop at once if this teleop moves the robot. `why` is shown."""
        if self._drives:
            now = time.monotonic()
            self.pilot.stop(now)
            self.publish(now)
        else:  # keys may be held that together move nothing, and a stop that has begun goes on
            self.pilot.let_go()
        self.warning = why or self.warning
        return ""

    def halt(self) -> None:
        """Stop the robot if this teleop moves it: zeros until odom shows rest, at most a second."""
        self.let_go()
        while self.pilot.engaged:
            time.sleep(0.01)
            self.publish(time.monotonic())

    def publish(self, now: float) -> None:
        """Publish what the pilot says at `now`, if anything."""
        since = self.pilot.stopping_since()
        self.sent = self.pilot.command(now, since is not None and self.helm.rests(since))
        self.due = now + 1 / (self.pilot.settings.repeat_rate or 20.0)
        if self.sent is not None:
            self.helm.put(self.sent)

    def ring(self) -> list[str]:
        """The robots that Tab goes round: those that were named, or else all that listen."""
        if len(self._robots) > 1:
            return self._robots
        keys = {end.key for end in self.graph.endpoints() if end.kind == "sub"}
        places = {
            key.removesuffix("cmd_vel").rstrip("/") for key in keys if key == "cmd_vel" or key.endswith("/cmd_vel")
        }
        places = {place for place in places if "/" not in place and "*" not in place}
        return sorted({*places, self.helm.robot, *([self._first] if self._command else [])})

    def listeners(self) -> list[str]:
        """Who reads the commands."""
        return [end.node for end in on_key(self.graph.endpoints(), self.helm.key, "sub")]

    @property
    def _drives(self) -> bool:
        return self.pilot.engaged and self.pilot.stopping_since() is None

    def _goes_on(self) -> bool:
        """Whether this robot has to rest before the next one. A key is meant for that, and would move this one."""
        if self._wanted == "next_robot" and not self.pilot.engaged:
            self._do_wanted()
        return self._wanted == "next_robot"

    def _do_wanted(self) -> None:
        wanted, self._wanted = self._wanted, ""
        if wanted == "resume":
            return self._hand_over()
        ring = self.ring()
        robot = ring[(ring.index(self.helm.robot) + 1) % len(ring)]
        if robot == self.helm.robot:
            self.warning = "there is no other robot"
        else:
            self.helm.close()
            self.helm, self.sent = self._helm(robot), None
            self.pilot.switch(robot)

    def _helm(self, robot: str) -> Helm:
        return Helm(self.bus, robot, self._command if robot == self._first else "", self._stamped)

    def _hand_over(self) -> None:
        """Tell the sim that overruled sources may drive again."""
        try:
            key = self.helm.beside("resume")
            self.warning = self.bus.call(key, TriggerRequest(), TriggerReply, RESUME_TIMEOUT).message
        except ServiceError as error:
            self.warning = f"not handed over: {error}"
