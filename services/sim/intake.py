"""What arrives on one robot's cmd_vel: checked, limited, and handed to the arbiter."""

from collections.abc import Callable

from holozen.limits import STOP, Planar, clamp_speed
from holozen.messages import CommandStatus, Twist, TwistStamped
from holozen.readers import PRIORITIES, Received
from holozen.tell import say
from holozen.wire import COMMAND_SILENCE, MAX_STAMP_AGE

from .arbiter import Arbiter
from .ledger import Ledger, source_of

MAX_LINEAR = 5.0  # m/s
MAX_ANGULAR = 10.0  # rad/s


class Intake:
    """Judges commands and hands the good ones to the arbiter. `keys` are the robot's: its cmd_vel first, which is named
    in what is told.
    """

    def __init__(
        self, key: str, arbiter: Arbiter, linear: float, angular: float, say: Callable[[str], None] = say,
        others: tuple[str, ...] = (),
    ) -> None:  # fmt: skip
        self.arbiter, self.ledger = arbiter, Ledger(say)
        self.keys, self._linear, self._angular = (key, *others), linear, angular

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
        message, source = self.ledger.open(received, self.keys, now), source_of(received)
        if message is None:
            return None
        twist = message.twist if isinstance(message, TwistStamped) else message
        if isinstance(message, TwistStamped):
            age = _age(message, clocks)
            if abs(age) > MAX_STAMP_AGE:
                return self._refuse("stale", f"stamp is {age:.1f} s old; at most {MAX_STAMP_AGE} s", source, now)
            heard = min(heard, now - age)
        velocity = (twist.linear.x, twist.linear.y, twist.angular.z)
        if now - heard > COMMAND_SILENCE and velocity != STOP:
            return self._refuse("late", f"it waited up to {now - heard:.1f} s for the sim", source, now)
        return self._obey(velocity, source, PRIORITIES.index(received.sample.priority), now, heard)

    def status(self, now: float) -> CommandStatus:
        """Who drives, and the counts so far."""
        driver = self.arbiter.driver(now)
        return CommandStatus(
            obeyed=driver.source if driver else "",
            priority=PRIORITIES[driver.rank] if driver else "",
            held=self.arbiter.held,
            resumed=self.arbiter.resumed,
            accepted=self.ledger.accepted,
            refused=dict(self.ledger.refused),
            last_refusal=self.ledger.last,
        )

    def _obey(self, velocity: Planar, source: str, rank: int, now: float, heard: float) -> None:
        limited = clamp_speed(velocity, self._linear, self._angular)
        if reason := self.arbiter.offer(source, rank, limited, now, heard):
            return self._refuse(reason.partition(":")[0], reason, source, now)
        self.ledger.accepted += 1
        if limited != velocity:
            text = f"over the limits of {self._linear:g} m/s and {self._angular:g} rad/s, clamped: {velocity}"
            self._refuse("clamped", text, source, now)
        return None

    def _refuse(self, kind: str, reason: str, source: str, now: float) -> None:
        self.ledger.refuse(self.keys[0], kind, reason, source, now)


def _age(message: TwistStamped, clocks: tuple[float, ...]) -> float:
    """The age in seconds of a stamp by the clock that is nearest to it; 0 without a stamp."""
    stamp = message.header.stamp.seconds()
    return min((now - stamp for now in clocks), key=abs) if stamp else 0.0
