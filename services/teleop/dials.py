"""What the screen shows of a robot: where it is, how far away the sim is, who drives."""

import math
import threading
import time
from collections import deque

from holozen.bus import Bus
from holozen.errors import BusError
from holozen.limits import STOP, Planar
from holozen.messages import CommandStatus, Odometry, TriggerRequest, Twist

from .cockpit import Cockpit
from .pilot import DEAD_MAN, Pilot
from .state import Source, State

ASK_EVERY, ASK_LIMIT = 1.0, 0.2  # s
TRAIL_STEP, TRAIL_LENGTH = 0.05, 400  # m, points
PACE_OVER = 1.0  # s of odom that the real-time factor is taken from
FARTHEST = 1e6  # m; what is farther is no place on a map


class RoundTrip:
    """Measures, once a second, how long the sim takes to answer. `close` before the bus is closed."""

    def __init__(self, bus: Bus, key: str) -> None:
        self.key = key  # what is asked for
        self.seconds: float | None = None
        self._bus = bus
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._measure, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Measure no more."""
        self._closing.set()
        self._thread.join(2 * ASK_LIMIT)

    def _measure(self) -> None:
        while not self._closing.wait(ASK_EVERY):
            began = time.monotonic()
            try:
                self._bus.call(self.key, TriggerRequest(), CommandStatus, ASK_LIMIT)
                self.seconds = time.monotonic() - began
            except BusError:
                self.seconds = None


class Track:
    """The way that a robot came, and how fast its clock runs, from its odom."""

    def __init__(self) -> None:
        self.pose: tuple[float, float, float] | None = None  # x, y, yaw
        self.trail: deque[tuple[float, float]] = deque(maxlen=TRAIL_LENGTH)
        self._times: deque[tuple[float, float]] = deque()  # of the odom's clock and of ours

    def see(self, odom: Odometry, now: float) -> None:
        """Take the newest odom, which was read at `now`."""
        position, stamp = odom.pose.pose.position, odom.header.stamp.seconds()
        yaw = odom.pose.pose.orientation.yaw()
        if not all(abs(value) < FARTHEST for value in (position.x, position.y, yaw)):
            return
        self.pose = position.x, position.y, yaw
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
        """Seconds of the odom's clock in a second of ours; None while that is not known."""
        if len(self._times) < 2:
            return None
        (began, ours), (ended, now) = self._times[0], self._times[-1]
        return (ended - began) / (now - ours) if now - ours > PACE_OVER / 2 else None


class Dials:
    """Reads what there is to show."""

    def __init__(self, cockpit: Cockpit) -> None:
        self._cockpit = cockpit
        self._track, self._of = Track(), cockpit.helm
        self._round_trip = RoundTrip(cockpit.bus, cockpit.helm.status_key)

    def close(self) -> None:
        """Measure no more."""
        self._round_trip.close()

    def state(self, why: str, now: float, ascii: bool) -> State:
        """What there is to show. `why` says why the mode is what it is."""
        cockpit, helm = self._cockpit, self._cockpit.helm
        if helm is not self._of:
            self._track, self._of = Track(), helm
        self._round_trip.key = helm.status_key
        odom, age = helm.odom.read()
        if odom is not None:
            self._track.see(odom, now)
        status = helm.status()
        state = State(
            robot=helm.robot,
            others=[robot for robot in cockpit.ring() if robot != helm.robot],
            command=_planar(cockpit.sent) if cockpit.sent else None,
            measured=_planar(odom.twist.twist) if odom else STOP,
            odom_age=age,
            stale=helm.stale(),
            round_trip=self._round_trip.seconds,
            real_time_factor=self._track.real_time_factor(),
            pose=self._track.pose,
            trail=self._track.trail,
            listeners=cockpit.listeners(),
            source=cockpit.bus.source,
            key=helm.key,
            keys=cockpit.pilot.layout.table if cockpit.help else cockpit.pilot.layout.help,
            help=cockpit.help,
            warning=cockpit.warning or cockpit.pilot.note or _refusal(status, cockpit.bus.source),
            why=why,
            ascii=ascii,
        )
        _show_pilot(state, cockpit.pilot)
        _show_status(state, status)
        return state


def _show_pilot(state: State, pilot: Pilot) -> None:
    settings = pilot.settings
    state.mode, state.deadman, state.deadman_held = settings.mode, settings.deadman, DEAD_MAN in pilot.grip.keys
    state.speed, state.speed_limit = settings.speed, settings.speed_limit
    state.turn, state.turn_limit = settings.turn, settings.turn_limit


def _show_status(state: State, status: CommandStatus) -> None:
    state.obeyed, state.held, state.stopped = status.obeyed, status.held, status.stopped
    state.sources = [Source(s.source, s.priority, s.rate, s.obeyed, s.held) for s in status.sources]


def _planar(twist: Twist) -> Planar:
    return twist.linear.x, twist.linear.y, twist.angular.z


def _refusal(status: CommandStatus, source: str) -> str:
    """Why the last of our commands was refused, if it was."""
    return status.last_refusal.partition(": ")[2] if status.last_refusal.startswith(f"{source}: ") else ""
