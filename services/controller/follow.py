"""Drives to goals, which it requests one after another, while no other source drives the robot."""

import threading
import time
from collections.abc import Callable
from functools import partial

from holozen.background import background
from holozen.bus import Bus
from holozen.limits import STOP, Planar
from holozen.messages import (
    CommandStatus,
    NextGoalReply,
    NextGoalRequest,
    Odometry,
    PoseStamped,
    Twist,
)
from holozen.messages.message import not_finite
from holozen.odometry import RobotFeedback
from holozen.suggest import listed, suggest
from holozen.transport.actions import OLD
from holozen.transport.beat import GOAL_BEAT
from holozen.transport.errors import NoReply, ServiceError
from holozen.transport.graph import Endpoint
from holozen.transport.pubsub import Publisher, Received
from holozen.wire import COMMAND_SILENCE, PRIORITY_OF, key_for

from .backlog import LATE, SUSPENDED, Backlog
from .goto import Gains, Leg, PlanarPose, arrived, error, velocity
from .journeys import MAX_AGE, GoalServers, Journey
from .yield_policy import YieldPolicy

PERIOD = 0.05  # s of the odom's clock between two commands
PATIENCE = 0.5  # s for next_goal to reply, and between two requests
BEAT_EVERY = 0.05  # s; the longest wait without a beat
STOP_FOR, STOP_EVERY = 1.0, 0.05  # s; how long and how often a stop is repeated
NOTICE = 3.0  # s without any odom after which it reports the robots that there are
LARGEST_GOAL = 65_536  # bytes
MAX_DISTANCE = 1e6  # m; farther goals and poses are errors
LOST = 2.0  # s without fresh odom until an action's goal is aborted; the robot stops long before
# A goal that was sent just after a resume may arrive before the status that tells of the resume.
STATUS_DELAY = 0.5  # s for which an action's goal waits for the right to drive
FRAMES = ("", "odom", "map", "world")  # frames of a goal that all mean the frame of odom
ENDS = "the controller ends"
NO_ECHO = "its sender has not heard from this controller yet; send it again in a moment"
REMOVED = "the robot was removed or replaced, or the link to it was lost"
RESET = "the robot was reset or moved"
ONLY_TURNS = (
    "this robot cannot strafe: its drive only goes forward, backward and turns; it may "
    "miss goals beside it"
)


class Way:
    """The way to one goal.

    goal: Where it leads.
    leg: What was driven of it, from where the robot was first seen; None before.
    commanded: When the last command was sent, in s of the odom's clock.
    """

    def __init__(self, goal: PlanarPose) -> None:
        self.goal = goal
        self.leg: Leg | None = None
        self.commanded = 0.0

    def update(self, pose: PlanarPose, stamp: float) -> Leg:
        """Take the robot's pose at `stamp` (s of the odom's clock). A clock that goes back is that
        of a new robot, or of a sim that was restarted: a new leg begins.
        """
        if self.leg is None or stamp < self.commanded:
            self.leg = Leg(pose, self.goal, stamp)
            self.commanded = stamp - PERIOD
        self.leg.update(pose, stamp)
        return self.leg


class GoalRequest:
    """A request for goal `number` of the list, in a thread of its own."""

    def __init__(self, bus: Bus, number: int) -> None:
        self.number = number
        self._bus = bus
        self._done = threading.Event()
        self._result = background(self._call)

    def wait(self, seconds: float) -> bool:
        """Wait for the answer, at most `seconds`; returns whether it is there."""
        return self._done.wait(seconds)

    def goal(self) -> NextGoalReply:
        """The answer, once it is there. Raises ServiceError if the service refused, or did not
        reply.
        """
        return self._result()

    def _call(self) -> NextGoalReply:
        try:
            return self._bus.call(
                "next_goal", NextGoalRequest(self.number), NextGoalReply, PATIENCE
            )
        finally:
            self._done.set()


class Lap:
    """One visit of each goal of the list.

    legs: Those that were driven.
    request: The one that is under way for the next goal; None if there is none.
    retry_at: When the next request is sent, in s (monotonic).
    way: To the goal that the list gave; None while there is none.
    is_last: Whether the list ends with that goal.
    is_over: Whether the list has ended.
    """

    def __init__(self) -> None:
        self.legs: list[Leg] = []
        self.request: GoalRequest | None = None
        self.retry_at = time.monotonic()
        self.way: Way | None = None
        self.is_last = False
        self.is_over = False

    def interrupt(self) -> None:
        """The robot is driven elsewhere: the goal is asked for again after that."""
        self.request = None
        self.way = None

    def set_out(self, goal: NextGoalReply) -> None:
        """The list has given a goal."""
        self.way = Way((goal.x_goal, goal.y_goal, goal.theta_goal))
        self.is_last = bool(goal.end_of_list)

    def arrive(self, leg: Leg) -> None:
        """The robot rests at the goal."""
        self.legs.append(leg)
        self.way = None
        self.is_over = self.is_last


class Follower:
    """Drives one robot from goal to goal until `stop` is set. `held`: it waits for a resume first.

    gains: May be replaced while it drives.
    status: The robot's cmd_vel_status.

    A goal on `goal_pose`, or of an action, has precedence: the robot drives there at once, and
    stays until the next one or a resume. While the controller yields, the newest goal of goal_pose
    waits for the resume; one of an action is aborted. Both are for the robot that is there: one
    that was replaced or reset does not drive there. The list is for whichever robot is there.

    `lap` polls for goals once a tick. A tick then acts on what there is: a journey, the way to a
    goal of the list, or neither, and then it asks for one.
    """

    def __init__(
        self,
        bus: Bus,
        robot: str,
        gains: Gains,
        stop: threading.Event,
        report: Callable[[str], None],
        held: bool = False,
    ) -> None:
        self._bus, self._stop, self._report = bus, stop, report
        self.gains = gains
        self.status = bus.latest(key_for("cmd_vel_status", robot), CommandStatus)
        self._odom = RobotFeedback(bus, key_for("odom", robot), self.status)
        self._commands: Publisher[Twist] = bus.publisher(
            key_for("cmd_vel", robot), Twist, PRIORITY_OF["controller"]
        )
        self._beat = bus.beat(GOAL_BEAT)  # before the token of what it obeys
        self._goals = bus.subscribe(
            key_for("goal_pose", robot), PoseStamped, depth=1, limit=LARGEST_GOAL
        )
        self._journey: Journey | None = None  # the present one, of goal_pose or an action
        self._way: Way | None = None  # to the next pose of the journey
        self._backlog = Backlog()
        self._actions = GoalServers(bus, robot, self._refusal, report)
        # s; the time of the last fresh odom, or of the start of the journey
        self._seen = time.monotonic()
        self._policy = YieldPolicy(bus.source, held, robot)
        self._now: Planar = STOP  # the last command
        self._sent = time.monotonic()  # s; when that was sent
        self._robot, self._began, self._others = robot, time.monotonic(), ""
        self._yielded = False
        self._strafes = True  # until a status says otherwise, which is reported once
        self._reported = ""

    def lap(self) -> list[Leg]:
        """Visit every goal of the list once. Returns the legs that were driven: fewer if it was
        stopped early.
        """
        lap = Lap()
        while not self._stop.is_set() and not lap.is_over:
            self._poll_goals()
            if self._journey:
                lap.interrupt()
                self._travel(self._journey)
            elif lap.way:
                self._visit(lap, lap.way)
            else:
                self._ask(lap)
        return lap.legs

    def halt(self) -> None:
        """Stop the robot if this controller moves it: zeros until odom shows rest, for at most a
        second.
        """
        since = time.monotonic()
        while self._now != STOP:
            count = self._odom.count
            self._commands.put(Twist())
            self._odom.wait(count, STOP_EVERY)
            self._beat.poll()
            if time.monotonic() - since > STOP_FOR or self._odom.rests(since):
                self._now = STOP

    def close(self) -> None:
        """End all goals: this controller no longer drives."""
        self._actions.close(ENDS)
        if self._journey:
            self._journey.give_up(ENDS)

    def _poll_goals(self) -> None:
        """Take the newest goal of goal_pose or an action; it ends the journey before. A goal that
        may have waited for this process, or in a link, is refused: what happened to the robot
        meanwhile is unknown.
        """
        is_silent = self._odom.count > 0 and self._odom.read()[1] > self._odom.patience(SUSPENDED)
        late = self._backlog.update(time.monotonic(), is_silent)
        self._beat.poll()
        if (received := self._goals.try_recv()) is not None:
            self._take_pose(received, late)
        if (journey := self._actions.take()) is None:
            return
        # a link that is held up for so long is lost, with the requests that wait in it
        if late == LATE:
            self._report(f"{journey.origin}: refused: {late}")
            journey.give_up(late)
            return
        self._set_out(journey, "a newer goal came")
        journey.begin()

    def _take_pose(self, received: Received[PoseStamped], late: str) -> None:
        """Set out to a goal of goal_pose, or report why not. `late`: why it may have waited on its
        way; else empty.
        """
        reason = received.error or late or self._age_refusal(received)
        goal = received.message
        if not reason and goal:
            reason = self._refusal(goal)
        if reason:
            self._report(f"goal_pose: refused: {reason}")
        elif goal:
            x, y, theta = goal.pose.planar()
            self._report(
                f"goal_pose: ({x:.2f}, {y:.2f}) by {received.source or 'an unknown sender'}"
            )
            self._set_out(Journey("goal_pose", [(x, y, theta)]), "a newer goal came on goal_pose")

    def _age_refusal(self, received: Received[PoseStamped]) -> str:
        """Why a goal is too old, by its echo of this controller's beat; empty if it is not, or it
        is of a foreign program, which has none.
        """
        if not (stamp := received.stamp):
            return ""
        age = self._beat.own.age(stamp.echoes)
        if age is None:
            return NO_ECHO
        return OLD.format(limit=MAX_AGE) if age > MAX_AGE else ""

    def _set_out(self, journey: Journey, why: str) -> None:
        """Begin a journey instead of the present one, which ends for that reason."""
        if self._journey:
            self._journey.give_up(why)
        self._journey = journey
        self._way = None
        self._seen = time.monotonic()
        self._poll_change()  # what happened before does not end this one
        self._policy.set_out()

    def _refusal(self, goal: PoseStamped) -> str:
        """Why the robot does not drive to a goal; empty if it does."""
        odom, _ = self._odom.read()
        frames = {*FRAMES, odom.header.frame_id if odom else ""}
        if (frame := goal.header.frame_id) not in frames:
            return f"its frame is {frame[:80]!r}; give it in 'odom'"
        if bad := not_finite(goal):
            return f"{bad} is not a finite number"
        if max(abs(goal.pose.position.x), abs(goal.pose.position.y)) > MAX_DISTANCE:
            return f"it is more than {MAX_DISTANCE:g} m away"
        return ""

    def _travel(self, journey: Journey) -> None:
        """A tick of a journey: drive on to its next pose. The robot stays at the last one, or where
        the journey is cancelled or given up.
        """
        odom = self._next_odom()
        if journey.is_canceled or self._give_up(journey, odom):
            self.halt()
            self._end(journey)
            return
        if self._way is None:
            self._way = Way(journey.left[0])
        if not self._approach(self._way, odom, journey):
            return
        journey.reached()
        self._way = None
        if not journey.left:
            self._end(journey)

    def _end(self, journey: Journey) -> None:
        journey.end()
        self._journey = None
        self._policy.stay(journey.origin)

    def _visit(self, lap: Lap, way: Way) -> None:
        """A tick on the way to a goal of the list."""
        if self._approach(way, self._next_odom()) and way.leg:
            lap.arrive(way.leg)

    def _ask(self, lap: Lap) -> None:
        """A tick without a goal: ask for the next one of the list, or wait for the answer."""
        if lap.request is None:
            wait = lap.retry_at - time.monotonic()
            if wait > 0:
                self._stop.wait(min(wait, BEAT_EVERY))
                return
            lap.request = GoalRequest(self._bus, len(lap.legs))
        if lap.request.wait(BEAT_EVERY):
            self._take_answer(lap, lap.request)
            lap.request = None

    def _take_answer(self, lap: Lap, request: GoalRequest) -> None:
        number = request.number
        try:
            goal = request.goal()
            if all(
                abs(value) <= MAX_DISTANCE for value in (goal.x_goal, goal.y_goal, goal.theta_goal)
            ):
                lap.set_out(goal)
                return
            self._report_hold(
                f"goal {number} is more than {MAX_DISTANCE:g} m away; waiting for another"
            )
        except NoReply as silence:
            absence = self._absence()
            reason = f"{silence}; `holozen pose-service` starts one{'; ' * bool(absence)}{absence}"
            self._report_hold(f"waiting for goal {number}: {reason}")
        except ServiceError as failure:
            self._report_hold(f"goal {number}: {failure}")
            lap.is_over = number > 0  # the list got shorter
        lap.retry_at = time.monotonic() + PATIENCE

    def _beat_until(self, wait: Callable[[float], bool], seconds: float) -> bool:
        """Wait for at most `seconds`, and beat meanwhile; returns what `wait` does, which is called
        for parts of it.
        """
        while not (done := wait(min(BEAT_EVERY, seconds))) and seconds > BEAT_EVERY:
            seconds -= BEAT_EVERY
            self._beat.poll()
        return done

    def _approach(self, way: Way, odom: Odometry | None, journey: Journey | None = None) -> bool:
        """Command the velocity with which the robot drives on from `odom`. Returns whether it has
        arrived, and rests.

        Without an odom nothing is commanded. The `journey` is told of the progress.
        """
        if odom is None:
            if self._policy.yielded:
                way.leg = None  # a new leg begins where the other source left the robot
            return False
        stamp, pose = odom.header.stamp.seconds(), odom.pose.pose.planar()
        leg = way.update(pose, stamp)
        if journey:
            journey.follow(leg, odom, self.gains.max_speed)
        left = error(pose, way.goal)
        if arrived(left, self._now, self.gains):
            self.halt()
            return True
        passed = stamp - way.commanded
        if min(passed, time.monotonic() - self._sent) > COMMAND_SILENCE:
            self._now = STOP  # this process was suspended, and the robot has stopped
        if passed >= PERIOD - 1e-6:
            self._command(velocity(left, self._now, self.gains, min(passed, 2 * PERIOD)))
            way.commanded = stamp
        return False

    def _give_up(self, journey: Journey, odom: Odometry | None) -> bool:
        """Give the journey up if it was for the robot of before, the controller may not drive, or
        there was no odom. Returns whether that ends it.
        """
        if change := self._poll_change():
            self._report(f"{journey.origin}: given up: {change}")
            journey.give_up(change)
            return True
        now = time.monotonic()
        reason = self._policy.reason
        if odom is None and reason and now - self._seen > STATUS_DELAY:
            return journey.give_up(f"the controller {reason}")
        # also if there is one now: this process may have been suspended
        if now - self._seen > LOST:
            return journey.give_up(f"there was no odom to act on for {LOST:g} s")
        if odom is not None:
            self._seen = now
        return False

    def _poll_change(self) -> str:
        """What has made it another robot since the last call, or put it back to its start; else
        empty.
        """
        removed, reset = self._odom.poll_removed(), self._odom.poll_reset()
        return REMOVED if removed else RESET if reset else ""

    def _next_odom(self) -> Odometry | None:
        """The next odom. None if this controller may not act on it, and then it sends no motion."""
        count = self._odom.count
        fresh = self._beat_until(partial(self._odom.wait, count), self._odom.stale_after)
        odom, _ = self._odom.read()
        status, _ = self.status.read()
        if status:
            self._policy.update(status)
        if reason := self._policy.reason:
            # another source drives, which even a stop of this controller would disturb
            self._now = STOP
            self._yielded = True
            self._report_hold(reason)
        elif not fresh:
            self.halt()
            self._report_hold(
                f"waiting for {self._absence() or 'odom: it is stale, or none was received'}"
            )
        elif odom is None or not all(
            abs(value) <= MAX_DISTANCE for value in odom.pose.pose.planar()
        ):
            self.halt()
            self._report_hold(f"waiting for odom: its pose is more than {MAX_DISTANCE:g} m away")
        else:
            # if it commanded the robot during a software stop, it has to let go by a stop
            if self._yielded:
                self._command(STOP)
            self._yielded = False
            self._report_hold("")
            if status and self._strafes and not status.strafes:
                self._strafes = False
                self._report(ONLY_TURNS)
            return odom
        return None

    def _absence(self) -> str:
        """That the robot is not there, with the present ones, if no odom came in NOTICE seconds
        since the start; else empty.
        """
        if self._odom.count:
            self._others = ""
        elif not self._others and time.monotonic() - self._began > NOTICE:
            robots = {
                end.key.removesuffix("odom").rstrip("/")
                for end in self._bus.endpoints()
                if _is_odom(end)
            }
            names = [robot or "the one at the root of the keys" for robot in robots]
            name = self._robot or "robot"
            self._others = (
                f"{name}: no node publishes its odom{suggest(name, names)}; there are: "
                f"{listed(names)}"
            )
        return self._others

    def _command(self, planar: Planar) -> None:
        self._commands.put(Twist.planar(*planar))
        self._now, self._sent = planar, time.monotonic()

    def _report_hold(self, text: str) -> None:
        """Report once why this controller waits, and with an empty text that it goes on."""
        if text and text != self._reported:
            self._report(text)
        elif self._reported and not text:
            self._report("continues")
        self._reported = text


def _is_odom(end: Endpoint) -> bool:
    return end.kind == "pub" and end.key.rpartition("/")[2] == "odom"
