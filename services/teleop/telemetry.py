"""What the screen shows of a robot: its position, the link to the sim, and the source that
drives.
"""

import math
from collections import deque

from holozen.limits import STOP, Planar
from holozen.messages import CommandStatus, Odometry, Twist
from holozen.odometry import round_trip
from holozen.scanners import Scanners

from .control.twist_mapper import DEAD_MAN
from .session import Session
from .view import Source, State

TRAIL_STEP, TRAIL_LENGTH = 0.05, 400  # m, points
PACE_OVER = 1.0  # s of odom over which the real-time factor is measured
FARTHEST = 1e6  # m; positions beyond are ignored


class Track:
    """A robot's trail and the pace of its clock, from its odom."""

    def __init__(self) -> None:
        self.pose: tuple[float, float, float] | None = None  # x, y, yaw
        self.trail: deque[tuple[float, float]] = deque(maxlen=TRAIL_LENGTH)
        self._times: deque[tuple[float, float]] = deque()  # times on the odom's clock and on ours

    def see(self, odom: Odometry, now: float) -> None:
        """Take the latest odom, read at `now`."""
        pose, stamp = odom.pose.pose.planar(), odom.header.stamp.seconds()
        if not all(abs(value) < FARTHEST for value in pose):
            return
        self.pose = pose
        if not self.trail or math.dist(self.trail[-1], self.pose[:2]) > TRAIL_STEP:
            self.trail.append(self.pose[:2])
        if self._times and stamp < self._times[-1][0]:
            self._times.clear()
            self.trail.clear()
        if not self._times or stamp > self._times[-1][0]:
            self._times.append((stamp, now))
        while now - self._times[0][1] > PACE_OVER and len(self._times) > 2:
            self._times.popleft()

    def real_time_factor(self) -> float | None:
        """Seconds on the odom's clock per second on ours; None while it is unknown."""
        if len(self._times) < 2:
            return None
        (began, ours), (ended, now) = self._times[0], self._times[-1]
        return (ended - began) / (now - ours) if now - ours > PACE_OVER / 2 else None


class Refusals:
    """Why the robot refuses what this teleop commands. A refusal is over once a later command is
    accepted.
    """

    def __init__(self) -> None:
        self._accepted = 0  # commands, at the last status
        self._refused = 0
        self._reason = ""

    def see(self, status: CommandStatus, source: str) -> str:
        """Take the latest status. Returns why the robot refuses the commands of `source` now; empty
        if it does not.
        """
        accepted, refused = status.accepted, sum(status.refused.values())
        if refused != self._refused:
            is_ours = status.last_refusal.startswith(f"{source}: ")
            self._reason = status.last_refusal.partition(": ")[2] if is_ours else ""
        elif accepted != self._accepted:
            self._reason = ""
        self._accepted, self._refused = accepted, refused
        return self._reason


class Telemetry:
    """Collects the state to show."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._track, self._refusals, self._tracked = Track(), Refusals(), session.client
        self._scanners = Scanners(session.bus, session.client.robot)

    def state(self, why: str, now: float, ascii: bool) -> State:
        """The state to show. `why` is the reason for the mode."""
        session, client = self._session, self._session.client
        if client is not self._tracked:
            self._track, self._refusals, self._tracked = Track(), Refusals(), client
            self._scanners.close()
            self._scanners = Scanners(session.bus, client.robot)
        odom, age = client.odom.read()
        if odom is not None:
            self._track.see(odom, now)
        status = client.status()
        refusal = self._refusals.see(status, session.bus.source)
        settings, layout = session.mapper.settings, session.mapper.layout
        if not client.strafes:
            layout = layout.without_strafing
        self._scanners.update(session.graph)
        return State(
            robot=client.robot,
            name=client.name or client.robot,
            others=[robot for robot in session.ring() if robot != client.robot],
            command=_planar(session.sent) if session.sent else None,
            measured=_planar(odom.twist.twist) if odom else STOP,
            odom_age=age,
            stale=client.odom.is_stale,
            round_trip=round_trip(status, session.bus.source) or None,
            real_time_factor=self._track.real_time_factor(),
            pose=self._track.pose,
            trail=self._track.trail,
            seen=self._scanners.points,
            listeners=session.listeners(),
            source=session.bus.source,
            key=client.key,
            keys=layout.table if session.help else layout.help,
            help=session.help,
            warning=session.warning or _unmoved(session, status) or refusal,
            why=why,
            ascii=ascii,
            mode=settings.mode,
            deadman=settings.deadman,
            deadman_held=DEAD_MAN in session.mapper.key_state.keys,
            speed=settings.speed,
            speed_limit=min(settings.speed_limit, status.max_linear or math.inf),
            turn=settings.turn,
            turn_limit=min(settings.turn_limit, status.max_angular or math.inf),
            obeyed=status.obeyed,
            held=status.held,
            stopped=status.stopped,
            paused=client.odom.is_paused,
            sources=[
                Source(s.source, s.priority, s.rate, s.obeyed, s.held) for s in status.sources
            ],
        )


def _unmoved(session: Session, status: CommandStatus) -> str:
    """Why the robot moves slower than the keys command, or not at all; empty if it obeys them."""
    if session.waiting:
        return session.waiting
    if status.limited and status.obeyed == session.bus.source:
        return status.limited
    settings, (x, y, _, turn) = session.mapper.settings, session.mapper.motion
    if y and not status.strafes:
        return "this robot cannot strafe: its drive only goes forward, backward and turns"
    if status.max_linear and math.hypot(x, y) * settings.speed > status.max_linear:
        return f"limit: the robot is driven at no more than {status.max_linear:g} m/s"
    if status.max_angular and abs(turn) * settings.turn > status.max_angular:
        return f"limit: the robot is turned at no more than {status.max_angular:g} rad/s"
    return session.mapper.note


def _planar(twist: Twist) -> Planar:
    return twist.linear.x, twist.linear.y, twist.angular.z
