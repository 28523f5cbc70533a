"""Drives to goals, which it requests one after another, while no other source drives the robot."""

import math
import threading
import time
from collections.abc import Callable

from holozen.bus import Bus
from holozen.limits import STOP, Planar
from holozen.messages import CommandStatus, NextGoalReply, NextGoalRequest, Odometry, PoseStamped, Twist
from holozen.messages.message import not_finite
from holozen.odometry import RobotFeedback
from holozen.suggest import listed, suggest
from holozen.transport.actions import OLD
from holozen.transport.errors import NoReply, ServiceError
from holozen.transport.graph import Endpoint, quoted
from holozen.transport.pubsub import Publisher, Received
from holozen.wire import COMMAND_SILENCE, PRIORITY_OF, key_for, resume_command

from .goto import Gains, Leg, Pose, arrived, error, velocity
from .journeys import MAX_AGE, GoalServers, Journey

PERIOD = 0.05  # s of the odom's clock between two commands
PATIENCE = 0.5  # s between two attempts to reach a service
STOP_FOR, STOP_EVERY = 1.0, 0.05  # s; how long and how often a stop is repeated
NOTICE = 3.0  # s without any odom after which it reports the robots that there are
LARGEST_GOAL = 65_536  # bytes
MAX_DISTANCE = 1e6  # m; farther goals and poses are errors
LOST = 2.0  # s without fresh odom, after which the goal of an action is aborted; the robot has stopped long before
SUSPENDED = 2.0  # s between two looks at the goals, or without odom: this process, or a link, was held up
CATCHING_UP = 0.5  # s after that in which goals still arrive that were sent before
FRAMES = ("", "odom", "map", "world")  # frames of a goal that all mean the frame of odom
GOAL = "a goal of "
ENDS = "the controller ends"
LATE = "the controller was suspended when it was sent; send it again"
HELD_UP = "no odom came before it, so a link may have held it up; send it again once odom comes"
REMOVED = "the robot was removed or replaced, or the link to it was lost"
RESET = "the robot was reset or moved"
ONLY_TURNS = "this robot cannot strafe: its drive only goes forward, backward and turns; it may miss goals beside it"
EARLIER = "an earlier source"  # one that drove before this controller's first status
RESUME = "resume with `{command}` or press r in the teleop"


class YieldPolicy:
    """Whether the controller may drive: it yields when another source drives, and drives again only after a resume.

    It reads cmd_vel_status, in which `source` is this controller. At first it yields to `yielded_to`, if that is given.
    """

    def __init__(self, source: str, yielded_to: str = "", robot: str = "") -> None:
        self._source = source
        self._resume = RESUME.format(command=resume_command(robot))
        self._resumed: float = math.inf  # resumes at the last status; those before the first status do not count
        self.yielded_to = yielded_to  # empty while this controller may drive
        self.stopped = ""  # the node that set the software stop, while it is set

    @property
    def reason(self) -> str:
        """Why this controller does not drive, and what would let it; empty while it may."""
        if self.stopped:
            return f"yields: the robot is stopped by {self.stopped}; `holozen release` ends that, then {self._resume}"
        if self.yielded_to == EARLIER:
            return f"yields: another source drove this robot; {self._resume}"
        return f"yields to {self.yielded_to}; {self._resume}" if self.yielded_to else ""

    def stay(self, origin: str) -> None:
        """A goal of goal_pose or of an action (`origin`) has ended: the robot stays until a resume or the next goal."""
        self.yielded_to = self.yielded_to or GOAL + origin

    def invited(self) -> None:
        """The next such goal has arrived."""
        if self.yielded_to.startswith(GOAL):
            self.yielded_to = ""

    def update(self, status: CommandStatus) -> None:
        """Take the newest status. A restarted sim has forgotten which source drove, this policy has not."""
        if status.resumed > self._resumed:
            self.yielded_to = ""
        self._resumed = status.resumed
        self.stopped = status.stopped
        if status.stopped:
            self.yielded_to = f"the stop by {status.stopped}"
        elif status.obeyed and status.obeyed != self._source:
            self.yielded_to = status.obeyed
        elif status.held and not self.yielded_to:
            self.yielded_to = EARLIER


class Backlog:
    """Whether goals that arrive now may have waited for this process, or in a link."""

    def __init__(self) -> None:
        self._looked, self._until, self._why = math.inf, -math.inf, ""

    def look(self, now: float, is_silent: bool) -> str:
        """Why a goal that arrives at `now` (s) is refused; empty if it cannot be old. `is_silent`: no odom comes."""
        before, self._looked = self._looked, now
        was_suspended = now - before > SUSPENDED
        if was_suspended or now >= self._until:
            self._why = LATE if was_suspended else HELD_UP
        if was_suspended or is_silent:
            self._until = now + CATCHING_UP + 2 * PATIENCE  # the next look may be two attempts to reach a service away
        return self._why if now < self._until else ""


class Follower:
    """Drives one robot from goal to goal until `stop` is set. `held`: it waits for a resume first.

    A goal on `goal_pose`, or of an action, has precedence: the robot drives there at once, and stays until the next one
    or a resume. While the controller yields, the newest goal of goal_pose waits for the resume; one of an action is
    aborted. Both are for the robot that is there: one that was replaced or reset does not drive there. The list is for
    whichever robot is there.
    """

    def __init__(
        self, bus: Bus, robot: str, gains: Gains, stop: threading.Event, report: Callable[[str], None],
        held: bool = False,
    ) -> None:  # fmt: skip
        self._bus, self._stop, self._report = bus, stop, report
        self.gains = gains  # may be replaced while it drives
        self._odom = RobotFeedback(bus, key_for("odom", robot))
        self.status = bus.latest(key_for("cmd_vel_status", robot), CommandStatus)
        self._commands: Publisher[Twist] = bus.publisher(key_for("cmd_vel", robot), Twist, PRIORITY_OF["controller"])
        self._goal_key = key = key_for("goal_pose", robot)
        self._goals = bus.subscribe(key, PoseStamped, depth=1, limit=LARGEST_GOAL)
        self._senders = bus.graph(f"@holozen/*/*/pub/*/*/*/{quoted(key)}")
        self._clocks = bus.peer_clocks(self._senders.has)
        self._wanted: Journey | None = None  # the present one, of goal_pose or an action
        self._backlog = Backlog()
        self._actions = GoalServers(bus, robot, self._refusal, report)
        self._seen = time.monotonic()  # s; the time of the last fresh odom, or of the start of the journey
        self._policy = YieldPolicy(bus.source, "--held" if held else "", robot)
        self._now: Planar = STOP  # the last command
        self._sent = -math.inf  # s; when that was sent
        self._robot, self._began, self._others = robot, time.monotonic(), ""
        self._yielded = False
        self._strafes = True  # until a status says otherwise, which is reported once
        self._reported = ""

    def lap(self) -> list[Leg]:
        """Visit every goal of the list once. Returns the legs that were driven: fewer if it was stopped early."""
        legs: list[Leg] = []
        while not self._stop.is_set():
            if journey := self._newest_journey():
                self._travel(journey)
                continue
            goal = self._ask(len(legs))
            if self._wanted:
                continue
            leg = goal and self._drive((goal.x_goal, goal.y_goal, goal.theta_goal), None)
            if self._wanted:
                continue
            if not goal or not leg:
                break
            legs.append(leg)
            if goal.end_of_list:
                break
        return legs

    def halt(self) -> None:
        """Stop the robot if this controller moves it: zeros until odom shows rest, for at most a second."""
        ends = time.monotonic() + STOP_FOR
        while self._now != STOP:
            count, since = self._odom.count, time.monotonic()
            self._commands.put(Twist())
            self._odom.wait(count, STOP_EVERY)
            if time.monotonic() > ends or self._odom.rests(since):
                self._now = STOP

    def close(self) -> None:
        """End all goals: this controller no longer drives."""
        self._actions.close(ENDS)
        if self._wanted:
            self._wanted.give_up(ENDS)

    def _newest_journey(self) -> Journey | None:
        """The newest journey of goal_pose or an action. A new one ends the one before. A goal that may have waited for
        this process, or in a link, is refused: what happened to the robot meanwhile is unknown.
        """
        is_silent = self._odom.count > 0 and self._odom.read()[1] > self._odom.patience(SUSPENDED)
        late = self._backlog.look(now := time.monotonic(), is_silent)
        self._clocks.track(self._senders.publishers(self._goal_key), now)
        self._clocks.poll(now)
        received = self._goals.try_recv()
        if received is not None:
            refusal = received.error or late or self._age_refusal(received, now)
            if reason := refusal or (received.message and self._refusal(received.message)):
                self._report(f"goal_pose: refused: {reason}")
            elif goal := received.message:
                x, y, theta = goal.pose.planar()
                self._report(f"goal_pose: ({x:.2f}, {y:.2f}) by {received.source or 'an unknown sender'}")
                self._set_out(Journey("goal_pose", [(x, y, theta)]), "a newer goal came on goal_pose")
        if journey := self._actions.take():
            if late == LATE:  # a link that is held up for so long is lost, with the requests that wait in it
                self._report(f"{journey.origin}: refused: {late}")
                journey.give_up(late)
                return self._wanted
            self._set_out(journey, "a newer goal came")
            journey.begin()
        return self._wanted

    def _age_refusal(self, received: Received[PoseStamped], now: float) -> str:
        """Why a goal is too old, by the clock of its sender; empty if it is not, or that clock is unknown."""
        stamp = received.stamp
        ages = stamp and self._clocks.ages(stamp.session, stamp.sent, now, stamp.member)
        return OLD.format(limit=MAX_AGE) if ages and ages[0] > MAX_AGE else ""

    def _set_out(self, journey: Journey, why: str) -> None:
        if self._wanted:
            self._wanted.give_up(why)
        self._wanted, self._seen = journey, time.monotonic()
        self._change()  # what happened before does not end this one
        self._policy.invited()

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
        """Drive to all poses of a journey, and stay at the last one, or where it is cancelled or given up."""
        while journey.left and self._drive(journey.left[0], journey):
            journey.reached()
        if not self._stop.is_set() and self._wanted is journey:
            journey.end()
            self._wanted = None
            self._policy.stay(journey.origin)

    def _ask(self, number: int) -> NextGoalReply | None:
        """Goal `number` of the list; waits for the service. None if `stop` is set, a journey comes first, or the list
        has become shorter.
        """
        while not self._stop.is_set() and not self._newest_journey():
            try:
                goal = self._bus.call("next_goal", NextGoalRequest(number), NextGoalReply, PATIENCE)
                if all(abs(value) <= MAX_DISTANCE for value in (goal.x_goal, goal.y_goal, goal.theta_goal)):
                    return goal
                self._report_hold(f"goal {number} is more than {MAX_DISTANCE:g} m away; waiting for another")
            except NoReply as silence:
                absence = self._absence()
                reason = f"{silence}; `holozen pose-service` starts one{'; ' * bool(absence)}{absence}"
                self._report_hold(f"waiting for goal {number}: {reason}")
            except ServiceError as failure:
                self._report_hold(f"goal {number}: {failure}")
                if number:  # the list got shorter: this lap is over
                    return None
            self._stop.wait(PATIENCE)
        return None

    def _drive(self, goal: Pose, journey: Journey | None) -> Leg | None:
        """Drive to a goal of the `journey`, or without one of the list. Returns the leg; None if the goal is not
        reached, since `stop` is set, another journey comes first, or the journey ends here.
        """
        leg: Leg | None = None
        before = 0.0
        while not self._stop.is_set() and self._newest_journey() is journey:
            odom = self._next_odom()
            if journey and (journey.is_canceled or self._is_given_up(journey, odom)):
                self.halt()
                return None
            if odom is None:
                leg = None if self._policy.yielded_to else leg  # a new leg begins where the other source left the robot
                continue
            stamp, pose = odom.header.stamp.seconds(), odom.pose.pose.planar()
            if leg is None or stamp < before:  # the first odom, or those of a restarted sim
                leg, before = Leg(pose, goal, stamp), stamp - PERIOD
            leg.update(pose, stamp)
            if journey:
                journey.follow(leg, odom, self.gains.max_speed)
            left = error(pose, goal)
            if arrived(left, self._now, self.gains):
                self.halt()
                return leg
            if min(stamp - before, time.monotonic() - self._sent) > COMMAND_SILENCE:
                self._now = STOP  # this process was suspended, and the robot has stopped
            if stamp - before >= PERIOD - 1e-6:
                self._command(velocity(left, self._now, self.gains, min(stamp - before, 2 * PERIOD)))
                before = stamp
        return None

    def _is_given_up(self, journey: Journey, odom: Odometry | None) -> bool:
        """Whether the journey ends here: it was for the robot of before, the controller may not drive, or there was no
        odom.
        """
        if change := self._change():
            self._report(f"{journey.origin}: given up: {change}")
            journey.give_up(change)
            return True
        now = time.monotonic()
        if odom is None and (reason := self._policy.reason):
            return journey.give_up(f"the controller {reason}")
        if now - self._seen > LOST:  # also if there is one now: this process may have been suspended
            return journey.give_up(f"there was no odom to act on for {LOST:g} s")
        if odom is not None:
            self._seen = now
        return False

    def _change(self) -> str:
        """What has made it another robot since the last call, or put it back to its start; else empty."""
        removed, reset = self._odom.was_removed(), self._odom.was_reset()
        return REMOVED if removed else RESET if reset else ""

    def _next_odom(self) -> Odometry | None:
        """The next odom. None if this controller may not act on it, and then it sends no motion."""
        count = self._odom.count
        fresh = self._odom.wait(count, self._odom.stale_after)
        odom, _ = self._odom.read()
        status, _ = self.status.read()
        if status:
            self._policy.update(status)
        if reason := self._policy.reason:
            self._now = STOP  # another source drives, which even a stop of this controller would disturb
            self._yielded = True
            self._report_hold(reason)
        elif not fresh:
            self.halt()
            self._report_hold(f"waiting for {self._absence() or 'odom: it is stale, or none was received'}")
        elif odom is None or not all(abs(value) <= MAX_DISTANCE for value in odom.pose.pose.planar()):
            self.halt()
            self._report_hold(f"waiting for odom: its pose is more than {MAX_DISTANCE:g} m away")
        else:
            if self._yielded:  # if it commanded the robot during a software stop, it has to let go by a stop
                self._command(STOP)
            self._yielded = False
            self._report_hold("")
            if status and self._strafes and not status.strafes:
                self._strafes = False
                self._report(ONLY_TURNS)
            return odom
        return None

    def _absence(self) -> str:
        """That the robot is not there, with the present ones, if no odom came in NOTICE seconds since the start; else
        empty.
        """
        if self._odom.count:
            self._others = ""
        elif not self._others and time.monotonic() - self._began > NOTICE:
            robots = {end.key.removesuffix("odom").rstrip("/") for end in self._bus.endpoints() if _is_odom(end)}
            names = [robot or "the one at the root of the keys" for robot in robots]
            name = self._robot or "robot"
            self._others = f"{name}: no node publishes its odom{suggest(name, names)}; there are: {listed(names)}"
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
