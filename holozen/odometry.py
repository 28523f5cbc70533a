"""A robot's odometry: its messages, and as feedback for driving it, whether it is stale or lost,
the robot rests, or is another one.
"""

import math
import time

from holozen.bus import Bus, Latest
from holozen.limits import Planar
from holozen.messages import CommandStatus, Header, Odometry, SimulationStatus
from holozen.messages import geometry_msgs as gm
from holozen.messages.simulation_interfaces import SimulationState
from holozen.rotation import XYZ, XYZW
from holozen.wire import ODOM_SILENCE, SIM_SILENCE

RESTS = 0.01  # m/s and rad/s; slower counts as at rest
# s without odom, once some arrived, so as not to drive blind; less than the sim's command timeout
LOST = 0.4
UNKNOWN = [0.0] * 36  # covariances, row by row
JUMP = 0.5  # m between two looks, more than its motion explains, that mean a reset


def odometry(
    header: Header,
    child: str,
    position: XYZ,
    rotation: XYZW,
    velocity: Planar,
    variances: list[float] = UNKNOWN,
) -> Odometry:
    """Odometry with a pose in the frame of `header` and a velocity in the body frame `child`."""
    pose = gm.PoseWithCovariance(gm.Pose.of(position, rotation), variances)
    return Odometry(
        header, child, pose, gm.TwistWithCovariance(gm.Twist.planar(*velocity), variances)
    )


def transform(header: Header, child: str, position: XYZ, rotation: XYZW) -> gm.TransformStamped:
    """The pose of the frame `child` in the frame of `header`."""
    return gm.TransformStamped(
        header, child, gm.Transform(gm.Vector3(*position), gm.Quaternion(*rotation))
    )


class RobotFeedback(Latest[Odometry]):
    """The newest odometry on `key`, for a driver, which has to know when its robot is another one,
    or starts again. The commands of `bus` move that robot, whose cmd_vel_status is `status`.
    """

    def __init__(self, bus: Bus, key: str, status: Latest[CommandStatus]) -> None:
        super().__init__(bus.state(key, Odometry))
        self._writers = bus.writers(key)
        self._source, self._status = bus.source, status
        self._sim = bus.latest("simulation_status", SimulationStatus)
        self._before: Odometry | None = None
        self._epoch: int | None = None

    @property
    def stale_after(self) -> float:
        """The age in s beyond which it is too old to show, or to act on, as current."""
        return self.patience(ODOM_SILENCE)

    @property
    def is_stale(self) -> bool:
        """Whether it is too old to show as current, or there was none yet."""
        return self.read()[1] > self.stale_after

    @property
    def is_lost(self) -> bool:
        """Whether it has stopped arriving."""
        return self.count > 0 and self.read()[1] > max(LOST, self.stale_after)

    @property
    def is_paused(self) -> bool:
        """Whether its sim is paused. What publishes no status, such as a real base, is not."""
        sim, age = self._sim.read()
        return sim is not None and sim.state == SimulationState.STATE_PAUSED and age < SIM_SILENCE

    def rests(self, since: float) -> bool:
        """Whether odom shows rest after a stop that was sent first at `since` (s, monotonic).

        Only odom that was sent after the robot had heard the stop counts: over a slow link, that
        which comes before may show a robot that had not begun to move. A robot without a status is
        taken to hear at once.
        """
        odom, age = self.read()
        if odom is None:
            return False
        status, _ = self._status.read()
        trip = round_trip(status, self._source) if status else 0.0
        if trip is None:
            return False
        return time.monotonic() - age > since + trip and odom.twist.twist.is_slow(RESTS)

    def poll_removed(self) -> bool:
        """Whether a publisher of its odom has left since the last call: it was removed, though
        another one may have taken its place.
        """
        tokens = list(iter(self._writers.try_recv, None))
        return any(token.is_deletion for token in tokens)

    def poll_reset(self) -> bool:
        """Whether the robot has been reset since the last call: a new epoch of the sim began, the
        robot's clock went back, or its position jumped.
        """
        sim, _ = self._sim.read()
        epoch, self._epoch = self._epoch, sim.epoch if sim else None
        before, self._before = self._before, self.read()[0]
        if epoch is not None and epoch != self._epoch:
            return True
        return (
            before is not None and self._before is not None and _starts_again(before, self._before)
        )

    def close(self) -> None:
        """Stop listening."""
        super().close()
        self._writers.close()
        self._sim.close()


def round_trip(status: CommandStatus, source: str) -> float | None:
    """Seconds from the beat that the last command of `source` returned until it was read: the way
    there and back, and up to 50 ms between two beats; 0 for a command without a beat. None if the
    robot has heard nothing from it lately.
    """
    return next((one.delay for one in status.sources if one.source == source), None)


def _starts_again(before: Odometry, now: Odometry) -> bool:
    """Whether the clock went back, or the robot is farther away than it can have driven."""
    seconds = now.header.stamp.seconds() - before.header.stamp.seconds()
    (x0, y0, _), (x, y, _) = before.pose.pose.planar(), now.pose.pose.planar()
    speed = max(
        math.hypot(odom.twist.twist.linear.x, odom.twist.twist.linear.y) for odom in (before, now)
    )
    return seconds < 0 or math.hypot(x - x0, y - y0) > JUMP + 2 * speed * seconds
