"""What arrives on one robot's cmd_vel: checked, limited, counted, and told at most once a second."""

import math
from collections import Counter
from collections.abc import Callable

from holozen.limits import Planar, clamp_speed
from holozen.messages import CommandStatus, Twist, TwistStamped, not_finite
from holozen.readers import PRIORITIES, Received
from holozen.tell import say
from holozen.wire import MAX_STAMP_AGE

from .arbiter import Arbiter

TELL_EVERY = 1.0  # s
MAX_LINEAR = 5.0  # m/s
MAX_ANGULAR = 10.0  # rad/s


class Intake:
    """Judges commands and hands the good ones to the arbiter. `key` names the robot's cmd_vel in what is told."""

    def __init__(
        self, key: str, arbiter: Arbiter, linear: float, angular: float, say: Callable[[str], None] = say
    ) -> None:
        self.arbiter = arbiter
        self._key, self._linear, self._angular, self._say = key, linear, angular, say
        self._accepted = 0
        self._refused: Counter[str] = Counter()
        self._last = ""
        self._told = -math.inf
        self._untold = 0

    def take(self, received: Received[Twist | TwistStamped], now: float, clocks: tuple[float, ...]) -> None:
        """Judge one sample at `now` (s, monotonic). `clocks`: the times in seconds that a stamp may be measured by."""
        sample, message = received.sample, received.message
        source = sample.source or f"anonymous ({sample.priority})"
        if message is None:
            kind = "oversized" if received.error.startswith("oversized") else "malformed"
            return self._refuse(kind, received.error, source, now)
        twist = message.twist if isinstance(message, TwistStamped) else message
        if bad := not_finite(twist):
            return self._refuse("not finite", f"{bad} is not a finite number", source, now)
        if isinstance(message, TwistStamped) and (late := _staleness(message, clocks)):
            return self._refuse("stale", f"stamp is {late:.1f} s off; at most {MAX_STAMP_AGE} s", source, now)
        velocity = (twist.linear.x, twist.linear.y, twist.angular.z)
        self._obey(velocity, source, PRIORITIES.index(sample.priority), now)

    def drop(self, count: int, now: float) -> None:
        """Count samples that waited too long to be trusted."""
        self._refuse("late", f"{count} commands waited while the sim stood still", "the queue", now, count)

    def status(self, now: float) -> CommandStatus:
        """Who drives, and the counts so far."""
        driver = self.arbiter.driver(now)
        return CommandStatus(
            obeyed=driver.source if driver else "",
            priority=PRIORITIES[driver.rank] if driver else "",
            held=self.arbiter.held,
            resumed=self.arbiter.resumed,
            accepted=self._accepted,
            refused=dict(self._refused),
            last_refusal=self._last,
        )

    def _obey(self, velocity: Planar, source: str, rank: int, now: float) -> None:
        limited = clamp_speed(velocity, self._linear, self._angular)
        if reason := self.arbiter.offer(source, rank, limited, now):
            return self._refuse(reason.partition(":")[0], reason, source, now)
        self._accepted += 1
        if limited != velocity:
            text = f"over the limits of {self._linear:g} m/s and {self._angular:g} rad/s, clamped: {velocity}"
            self._refuse("clamped", text, source, now)

    def _refuse(self, kind: str, reason: str, source: str, now: float, count: int = 1) -> None:
        self._refused[kind] += count
        self._last = f"{source}: {reason}"[:300]
        self._untold += count
        if now - self._told < TELL_EVERY:
            return
        more = f" (and {self._untold - count} more)" if self._untold > count else ""
        self._say(f"{self._key}: from {self._last}{more}")
        self._told, self._untold = now, 0


def _staleness(message: TwistStamped, clocks: tuple[float, ...]) -> float:
    """How far in seconds the stamp is from the nearest clock, if that is too far; else 0. No stamp is a fresh one."""
    stamp = message.header.stamp.seconds()
    if not stamp:
        return 0.0
    off = min(abs(now - stamp) for now in clocks)
    return off if off > MAX_STAMP_AGE else 0.0
