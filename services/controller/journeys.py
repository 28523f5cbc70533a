"""Where the controller is sent: by goal_pose, or by the actions navigate_to_pose and
follow_waypoints.
"""

import math
import threading
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from holozen.bus import Bus
from holozen.messages import Odometry, PoseStamped
from holozen.messages import nav2_msgs as nav
from holozen.messages.builtin_interfaces import Duration
from holozen.transport.actions import ActionServer, Goal, State
from holozen.wire import key_for

from .goto import Leg, PlanarPose

FEEDBACK_EVERY = 0.2  # s of the odom's clock
# s of a goal when it is accepted; an older one waited in a link, and what happened since is unknown
MAX_AGE = 2.0
MAX_POSES = 10_000  # of one goal, all loops included


class Journey:
    """Poses to visit, in order, and the key that they came on (`origin`). This class is for
    goal_pose, of which no client awaits the end.
    """

    def __init__(self, origin: str, poses: Sequence[PlanarPose]) -> None:
        self.origin, self.left = origin, deque(poses)

    @property
    def is_canceled(self) -> bool:
        """Whether its client has cancelled it."""
        return False

    def follow(self, leg: Leg, odom: Odometry, speed: float) -> None:
        """Called with the robot's progress towards the next pose, at no more than `speed` (m/s)."""

    def reached(self) -> None:
        """Called when the next pose is reached."""
        self.left.popleft()

    def give_up(self, reason: str) -> bool:
        """Called when the robot cannot go on. Returns whether that ends the journey; else it
        waits.
        """
        return False

    def end(self) -> None:
        """Called when the robot rests at the last pose, or where it stopped since the client
        cancelled.
        """


class GoalJourney(Journey):
    """The journey of an action's goal. Its end is published once, whatever its cause."""

    def __init__(
        self, origin: str, server: ActionServer, goal: Goal, poses: Sequence[PoseStamped], kind: Any
    ) -> None:
        super().__init__(origin, [one.pose.planar() for one in poses])
        self._server, self._goal, self._stamped, self._kind = server, goal, poses, kind
        self._began: float | None = None  # s, of the odom's clock
        self._reported: float | None = None  # s, of the odom's clock; the last feedback

    @property
    def is_canceled(self) -> bool:
        """Whether its client has cancelled it."""
        return self._goal.state is State.CANCELING

    def begin(self) -> None:
        """Tell the client that the robot is on the way."""
        with self._server.lock:
            if self._goal.state is State.ACCEPTED:
                self._server.move(self._goal, State.EXECUTING)

    def follow(self, leg: Leg, odom: Odometry, speed: float) -> None:
        """Publish the progress, every FEEDBACK_EVERY seconds."""
        if self._began is None:
            self._began = leg.began
        if self._reported is not None and leg.ended - self._reported < FEEDBACK_EVERY:
            return
        self._reported = leg.ended
        self._server.feedback(self._goal, self._progress(leg, odom, speed))

    def _progress(self, leg: Leg, odom: Odometry, speed: float) -> Any:
        if self._kind is nav.FollowWaypoints:
            return nav.FollowWaypointsFeedback(self._index(0))
        x, y, _ = odom.pose.pose.planar()
        distance = math.hypot(leg.goal[0] - x, leg.goal[1] - y)
        return nav.NavigateToPoseFeedback(
            PoseStamped(odom.header, odom.pose.pose),
            Duration.of(leg.ended - (self._began or 0.0)),
            Duration.of(distance / speed),
            distance_remaining=distance,
        )

    def _index(self, ahead: int) -> int:
        """The index, in the goal's list, of the waypoint that is `ahead` of the next one by that
        many.
        """
        done = len(self._stamped) - len(self.left)
        return int((self._goal.request.goal_index + done + ahead) % len(self._goal.request.poses))

    def give_up(self, reason: str) -> bool:
        """Abort the goal."""
        self._finish(State.CANCELED if self.is_canceled else State.ABORTED, reason)
        return True

    def end(self) -> None:
        """Let the goal succeed, or be cancelled if poses are left."""
        if self.left:
            self._finish(State.CANCELED, "it was cancelled")
        else:
            self._finish(State.SUCCEEDED, "")

    def _finish(self, state: State, reason: str) -> None:
        with self._server.lock:
            if self._goal.is_active:
                self._server.finish(self._goal, state, self._result(reason))

    def _result(self, reason: str) -> Any:
        unknown = self._kind.Result.UNKNOWN if reason else 0
        if self._kind is nav.NavigateToPose:
            return nav.NavigateToPoseResult(unknown, reason)
        done = len(self._stamped) - len(self.left)
        missed = [
            nav.MissedWaypoint(self._index(number), goal)
            for number, goal in enumerate(self._stamped[done:])
        ]
        return nav.FollowWaypointsResult(missed, unknown, reason)


class GoalServers:
    """Serves both actions, each in a thread of its own. `refusal` returns why a pose is refused, or
    "".
    """

    def __init__(
        self,
        bus: Bus,
        robot: str,
        refusal: Callable[[PoseStamped], str],
        report: Callable[[str], None],
    ) -> None:
        self._refusal, self._report = refusal, report
        self._lock = threading.Lock()
        self._newest: GoalJourney | None = None
        self._ended = ""  # why no goal is accepted any more
        for name, kind, poses in (
            ("navigate_to_pose", nav.NavigateToPose, _one),
            ("follow_waypoints", nav.FollowWaypoints, _looped),
        ):
            begin = partial(self._begin, name, kind, poses)
            ActionServer(
                bus, key_for(name, robot), kind, partial(self._refuses, poses), begin, MAX_AGE
            ).start()

    def take(self) -> GoalJourney | None:
        """The newest accepted goal, which is returned only once; else None."""
        with self._lock:
            newest, self._newest = self._newest, None
        return newest

    def close(self, reason: str) -> None:
        """Accept no more goals, and end the one that waits."""
        with self._lock:
            self._ended = reason
        if waiting := self.take():
            waiting.give_up(reason)

    def _refuses(self, poses: "Callable[[Any], Sequence[PoseStamped]]", goal: Any) -> str:
        if self._ended:
            return self._ended
        try:
            poses(goal)
        except ValueError as error:
            return str(error)
        if isinstance(goal, nav.NavigateToPoseGoal):
            return self._refusal(goal.pose)
        refused = ((number, self._refusal(pose)) for number, pose in enumerate(goal.poses))
        return next((f"pose {number}: {reason}" for number, reason in refused if reason), "")

    def _begin(self, name: str, kind: Any, poses: Any, server: ActionServer, goal: Goal) -> None:
        journey = GoalJourney(name, server, goal, poses(goal.request), kind)
        x, y, _ = journey.left[0]
        self._report(f"{name}: ({x:.2f}, {y:.2f}) by {server.caller or 'an unknown sender'}")
        with self._lock:
            before, self._newest = self._newest, journey
        if before:
            before.give_up("a newer goal came")


def _one(goal: Any) -> Sequence[PoseStamped]:
    if goal.behavior_tree:
        raise ValueError("there are no behavior trees here; leave behavior_tree empty")
    return [goal.pose]


def _looped(goal: Any) -> Sequence[PoseStamped]:
    """The poses from goal_index on, then all of them once for each further loop. Raises
    ValueError.
    """
    count = len(goal.poses)
    if not count:
        raise ValueError("it has no poses")
    if goal.goal_index >= count:
        raise ValueError(f"goal_index is {goal.goal_index}; use 0 to {count - 1}")
    if count * (goal.number_of_loops + 1) > MAX_POSES:
        raise ValueError(
            f"{count} poses in {goal.number_of_loops + 1} rounds; at most {MAX_POSES} in all"
        )
    return [*goal.poses[goal.goal_index :], *list(goal.poses) * goal.number_of_loops]
