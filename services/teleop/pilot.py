"""Keys to commands. Knows no clock, no screen, no socket: times are given, in seconds."""

from dataclasses import dataclass, replace

from holozen.messages import Twist, Vector3

from .keymap import MOVES, SPEEDS, Direction

STILL: Direction = (0, 0, 0, 0)
STOP_FOR = 1.0  # s; a stop is repeated until the robot rests, but not longer than this


@dataclass(frozen=True)
class Settings:
    """The parameters of teleop_twist_keyboard: m/s, rad/s, Hz, s. A `key_timeout` of 0 drives on until another key."""

    speed: float = 0.5
    turn: float = 1.0
    speed_limit: float = 1000.0
    turn_limit: float = 1000.0
    repeat_rate: float = 20.0
    key_timeout: float = 0.5


class Pilot:
    """Says what to publish: a command while a key drives, a stop until the robot rests, then nothing."""

    def __init__(self, settings: Settings) -> None:
        self.settings = replace(
            settings,
            speed=min(settings.speed, settings.speed_limit),
            turn=min(settings.turn, settings.turn_limit),
        )
        self.direction = STILL
        self._pressed = 0.0
        self._stopping: float | None = None  # since when

    @property
    def engaged(self) -> bool:
        """Whether a key drives or a stop is still being made sure of."""
        return self.direction != STILL or self._stopping is not None

    def press(self, key: str, now: float) -> None:
        """A key went down (or repeated). A key that is in no table stops the robot."""
        self._pressed = now
        if key in SPEEDS:
            self._scale(*SPEEDS[key])
        elif key in MOVES:
            self.direction, self._stopping = MOVES[key], None
        else:
            self.stop(now)

    def stop(self, now: float) -> None:
        """Let go of all keys."""
        self.direction = STILL
        self._stopping = now

    def expire(self, now: float) -> bool:
        """Stop if no key came for `key_timeout`. Whether that just happened."""
        timeout = self.settings.key_timeout
        expired = self.direction != STILL and timeout > 0 and now - self._pressed >= timeout
        if expired:
            self.stop(now)
        return expired

    def command(self, now: float, rests: bool) -> Twist | None:
        """What to publish at `now`, or None for silence. `rests`: odom, newer than the stop, shows no motion."""
        self.expire(now)
        if self._stopping is not None and (now - self._stopping > STOP_FOR or rests):
            self._stopping = None
        return self._twist() if self.engaged else None

    def stopping_since(self) -> float | None:
        """When the stop that is being made sure of began; None if there is none."""
        return self._stopping

    def _scale(self, speed: float, turn: float) -> None:
        now = self.settings
        self.settings = replace(
            now, speed=min(now.speed_limit, now.speed * speed), turn=min(now.turn_limit, now.turn * turn)
        )

    def _twist(self) -> Twist:
        x, y, z, turn = self.direction
        speed = self.settings.speed
        return Twist(Vector3(x * speed, y * speed, z * speed), Vector3(0.0, 0.0, turn * self.settings.turn))
