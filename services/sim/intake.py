"""What arrives on one robot's cmd_vel: checked, limited, counted, and told at most once a second."""

import math
from collections import Counter
from collections.abc import Callable

from holozen.limits import STOP, Planar, clamp_speed
from holozen.messages import CommandStatus, Twist, TwistStamped, not_finite
from holozen.readers import PRIORITIES, Received
from holozen.tell import say
from holozen.wire import COMMAND_SILENCE, MAX_STAMP_AGE

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

    def take(
        self,
        received: Received[Twist | TwistStamped],
        now: float,
        clocks: tuple[float, ...],
        heard: float | None = None,
    ) -> None:
        """Judge one sample at `now` (s, monotonic) that came at `heard` at the earliest (by default now).

        `clocks` are the times in seconds that a stamp may be measured by.
        """
        heard = now if heard is None else heard
        sample, message = received.sample, received.message
        source = sample.source or f"anonymous ({sample.priority})"
        if sample.key != self._key:
            return self._refuse("wildcard", f"a command for {sample.key!r}; name one robot", source, now)
        if message is None:
            kind = "oversized" if received.error.startswith("oversized") else "malformed"
            return self._refuse(kind, received.error, source, now)
        twist = message.twist if isinstance(message, TwistStamped) else message
        if bad := not_finite(twist):
            return self._refuse("not finite", f"{bad} is not a finite number", source, now)
        if isinstance(message, TwistStamped):
            age = _age(message, clocks)
            if abs(age) > MAX_STAMP_AGE:
                return self._refuse("stale", f"stamp is {age:.1f} s old; at most {MAX_STAMP_AGE} s", source, now)
            heard = min(heard, now - age)
        velocity = (twist.linear.x, twist.linear.y, twist.angular.z)
        if now - heard > COMMAND_SILENCE and velocity != STOP:
            return self._refuse("late", f"it waited up to {now - heard:.1f} s for the sim", source, now)
        self._obey(velocity, source, PRIORITIES.index(sample.priority), now, heard)

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

    def _obey(self, velocity: Planar, source: str, rank: int, now: float, heard: float) -> None:
        limited = clamp_speed(velocity, self._linear, self._angular)
        if reason := self.arbiter.offer(source, rank, limited, now, heard):
            return self._refuse(reason.partition(":")[0], reason, source, now)
        self._accepted += 1
        if limited != velocity:
            text = f"over the limits of {self._linear:g} m/s and {self._angular:g} rad/s, clamped: {velocity}"
            self._refuse("clamped", text, source, now)

    def _refuse(self, kind: str, reason: str, source: str, now: float) -> None:
        self._refused[kind] += 1
        self._last = f"{source}: {reason}"[:300]
        self._untold += 1
        if now - self._told < TELL_EVERY:
            return
        more = f" (and {self._untold - 1} more)" if self._untold > 1 else ""
        self._say(f"{self._key}: from {self._last}{more}")
        self._told, self._untold = now, 0


def _age(message: TwistStamped, clocks: tuple[float, ...]) -> float:
    """The age in seconds of a stamp by the clock that is nearest to it; 0 without a stamp."""
    stamp = message.header.stamp.seconds()
    return min((now - stamp for now in clocks), key=abs) if stamp else 0.0
