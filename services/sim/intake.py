"""What arrives on one robot's cmd_vel: checked, limited, and handed to the arbiter."""

from collections.abc import Callable

from holozen.limits import Planar, clamp_speed
from holozen.messages import CommandSource, CommandStatus, Twist, TwistStamped
from holozen.readers import PRIORITIES, Received
from holozen.tell import say
from holozen.wire import MAX_STAMP_AGE

from .arbiter import Arbiter
from .ledger import Ledger, source_of
from .motion import is_stop
from .speakers import Speakers

MAX_LINEAR = 5.0  # m/s
MAX_ANGULAR = 10.0  # rad/s
LINEAR, ANGULAR = (0.01, 50.0), (0.01, 100.0)  # what they may be set to


class Intake:
    """Judges commands and hands the good ones to the arbiter. `keys` are the robot's: its cmd_vel first, which is named
    in what is told.
    """

    def __init__(
        self, key: str, arbiter: Arbiter, linear: float, angular: float, say: Callable[[str], None] = say,
        others: tuple[str, ...] = (),
    ) -> None:  # fmt: skip
        self.arbiter, self.ledger, self._speakers = arbiter, Ledger(say), Speakers()
        self.keys, self.linear, self.angular = (key, *others), linear, angular

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
        rank, source = PRIORITIES.index(received.sample.priority), source_of(received)
        self._speakers.hear(source, rank, now)
        message = self.ledger.open(received, self.keys, now)
        if message is None:
            return None
        twist = message.twist if isinstance(message, TwistStamped) else message
        velocity = (twist.linear.x, twist.linear.y, twist.angular.z)
        if isinstance(message, TwistStamped) and not is_stop(velocity):  # a stop is obeyed whatever its sender's clock
            age = _age(message, clocks)
            if abs(age) > MAX_STAMP_AGE:
                self.arbiter.latch.refusal(source, False, now)  # it has not let go
                return self._refuse("stale", f"stamp is {age:.1f} s old; at most {MAX_STAMP_AGE} s", source, now)
            heard = min(heard, now - age)
        return self._obey(velocity, source, rank, now, heard)

    def status(self, now: float) -> CommandStatus:
        """Who drives, who speaks, and the counts so far."""
        driver, held = self.arbiter.driver(now), self.arbiter.holds
        obeyed = driver.source if driver else ""
        return CommandStatus(
            obeyed=obeyed,
            priority=PRIORITIES[driver.rank] if driver else "",
            held=self.arbiter.held,
            resumed=self.arbiter.resumed,
            accepted=self.ledger.accepted,
            refused=dict(self.ledger.refused),
            last_refusal=self.ledger.last,
            stopped=self.arbiter.latch.setter,
            sources=[
                CommandSource(source, PRIORITIES[rank], rate, source == obeyed, held(source, rank, now))
                for source, rank, rate in self._speakers.lately(now)
            ],
        )

    def _obey(self, velocity: Planar, source: str, rank: int, now: float, heard: float) -> None:
        limited = clamp_speed(velocity, self.linear, self.angular)
        if reason := self.arbiter.offer(source, rank, limited, now, heard):
            return self._refuse(reason.partition(":")[0], reason, source, now)
        self.ledger.accepted += 1
        if limited != velocity:
            text = f"over the limits of {self.linear:g} m/s and {self.angular:g} rad/s, clamped: {velocity}"
            self._refuse("clamped", text, source, now)
        return None

    def _refuse(self, kind: str, reason: str, source: str, now: float) -> None:
        self.ledger.refuse(self.keys[0], kind, reason, source, now)


def _age(message: TwistStamped, clocks: tuple[float, ...]) -> float:
    """The age in seconds of a stamp by the clock that is nearest to it; 0 without a stamp."""
    stamp = message.header.stamp.seconds()
    return min((now - stamp for now in clocks), key=abs) if stamp else 0.0
