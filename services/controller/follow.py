"""Follows goals: asks for one after another, drives there, and reports each leg."""

import threading
import time
from collections.abc import Callable

from holozen.bus import Bus
from holozen.errors import NoReply, ServiceError
from holozen.limits import STOP, Planar
from holozen.messages import CommandStatus, NextGoalReply, NextGoalRequest, Odometry, Twist
from holozen.publisher import Publisher
from holozen.wire import PRIORITY_OF, key_for, topic

from .goto import Gains, Leg, Pose, arrived, error, velocity
from .yielding import Manners

PERIOD = 0.05  # s of the odom's clock between two commands
PATIENCE = 0.5  # s between two tries to reach a service
STOP_FOR, STOP_EVERY = 1.0, 0.05  # s; how long and how often a stop is repeated
RESTS = 0.01  # m/s and rad/s; slower than this is standing
FARTHEST = 1e6  # m; what is farther is no goal and no pose


class Follower:
    """Drives one robot from goal to goal until `stop` is set."""

    def __init__(self, bus: Bus, robot: str, gains: Gains, stop: threading.Event, say: Callable[[str], None]) -> None:
        row = topic("odom")
        assert row is not None
        self._bus, self._stop, self._say, self._silence = bus, stop, say, row.silence
        self.gains = gains  # may be replaced while it drives
        self._odom = bus.latest(key_for("odom", robot), Odometry)
        self._status = bus.latest(key_for("cmd_vel_status", robot), CommandStatus)
        self._commands: Publisher[Twist] = bus.publisher(key_for("cmd_vel", robot), Twist, PRIORITY_OF["controller"])
        self._manners = Manners(bus.source)
        self._now: Planar = STOP
        self._yielded = False
        self._told = ""

    def lap(self) -> list[Leg]:
        """Visit every goal of the list once. Returns the legs driven; fewer than the list when told to stop."""
        legs: list[Leg] = []
        while not self._stop.is_set():
            goal = self._ask(len(legs))
            leg = goal and self._drive((goal.x_goal, goal.y_goal, goal.theta_goal))
            if not goal or not leg:
                break
            legs.append(leg)
            if goal.end_of_list:
                break
        return legs

    def halt(self) -> None:
        """Stop the robot if this controller moves it: zeros until odom shows rest, at most a second."""
        ends = time.monotonic() + STOP_FOR
        while self._now != STOP:
            count = self._odom.count
            self._commands.put(Twist())
            newer = self._odom.wait(count, STOP_EVERY)
            odom = self._odom.read()[0]
            if time.monotonic() > ends or (newer and odom and odom.twist.twist.is_slow(RESTS)):
                self._now = STOP

    def _ask(self, number: int) -> NextGoalReply | None:
        """Goal `number` of the list; waits for the service. None when told to stop meanwhile."""
        while not self._stop.is_set():
            try:
                goal = self._bus.call("next_goal", NextGoalRequest(number), NextGoalReply, PATIENCE)
                if all(abs(value) <= FARTHEST for value in (goal.x_goal, goal.y_goal, goal.theta_goal)):
                    return goal
                self._tell(f"goal {number} is more than {FARTHEST:g} m away; waiting for another")
            except NoReply as silence:
                self._tell(f"waiting for goal {number}: {silence}")
            except ServiceError as failure:
                self._tell(f"goal {number}: {failure}")
                if number:  # the list got shorter: this lap is over
                    return None
            self._stop.wait(PATIENCE)
        return None

    def _drive(self, goal: Pose) -> Leg | None:
        """Drive to a goal. None when told to stop before it was reached."""
        leg: Leg | None = None
        before = 0.0
        while not self._stop.is_set():
            odom = self._next_odom()
            if odom is None:
                leg = None if self._manners.yielded_to else leg  # where the other one left it, a new leg begins
                continue
            stamp, pose = odom.header.stamp.seconds(), _pose(odom)
            if leg is None or stamp < before:  # the first odom, or those of a sim that was started again
                leg, before = Leg(pose, goal, stamp), stamp - PERIOD
            leg.see(pose, stamp)
            left = error(pose, goal)
            if arrived(left, self._now, self.gains):
                self.halt()
                return leg
            if stamp - before >= PERIOD - 1e-6:
                self._command(velocity(left, self._now, self.gains, min(stamp - before, 2 * PERIOD)))
                before = stamp
        return None

    def _next_odom(self) -> Odometry | None:
        """The next odom, if this controller may act on it; else the robot is let go."""
        count = self._odom.count
        fresh = self._odom.wait(count, self._odom.patience(self._silence))
        odom, _ = self._odom.read()
        status, _ = self._status.read()
        if status:
            self._manners.see(status)
        if reason := self._manners.reason:
            self._now = STOP  # the other one has the robot: nothing of ours moves it, not even a stop
            self._yielded = True
            self._tell(reason)
        elif not fresh:
            self.halt()
            self._tell("waiting for odom: it is stale or was never heard")
        elif odom is None or not all(abs(value) <= FARTHEST for value in _pose(odom)):
            self.halt()
            self._tell(f"waiting for odom: its pose is more than {FARTHEST:g} m away")
        else:
            if self._yielded:  # it lets go with a stop, as whoever commanded a stopped robot has to
                self._command(STOP)
            self._yielded = False
            self._tell("")
            return odom
        return None

    def _command(self, planar: Planar) -> None:
        self._commands.put(Twist.planar(*planar))
        self._now = planar

    def _tell(self, text: str) -> None:
        """Tell what holds this controller up, once."""
        if text and text != self._told:
            self._say(text)
        elif self._told and not text:
            self._say("goes on")
        self._told = text


def _pose(odom: Odometry) -> Pose:
    pose = odom.pose.pose
    return pose.position.x, pose.position.y, pose.orientation.yaw()
