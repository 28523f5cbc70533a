"""Maps keys to commands. No clock, screen or socket: times are arguments, in seconds."""

import math
from collections.abc import Callable

from msgspec import Struct
from msgspec.structs import replace

from holozen.messages import Twist, Vector3

from ..input.kitty import Key
from .key_state import HOLD, KeyState
from .layouts import Direction, Layout

Deflection = tuple[float, float, float, float]
"""Forward, left, up, counter-clockwise: each is from -1 to 1, to be multiplied by the speed, the
last by the turn.
"""

STILL: Deflection = (0.0, 0.0, 0.0, 0.0)
STOP_FOR = 1.0  # s; a stop is repeated until the robot is at rest, but no longer than this
DEAD_MAN = "space"
PIECES = ("unknown", "escape")  # may be parts of a repeating key on a slow line


class Settings(Struct, frozen=True):
    """The parameters of teleop_twist_keyboard, in m/s, rad/s, Hz and s. With a `key_timeout` of
    None a key counts while the terminal repeats it.
    """

    speed: float = 0.5
    turn: float = 1.0
    speed_limit: float = 1000.0
    turn_limit: float = 1000.0
    repeat_rate: float = 20.0
    key_timeout: float | None = None
    mode: str = HOLD
    deadman: bool = False


class TwistMapper:
    """Decides what to publish: a command while keys drive, then a stop until the robot is at rest,
    then nothing.
    """

    def __init__(self, settings: Settings, layout: Layout) -> None:
        self.settings = replace(
            settings,
            speed=min(settings.speed, settings.speed_limit),
            turn=min(settings.turn, settings.turn_limit),
        )
        self.layout = layout
        self.key_state = KeyState(settings.mode, settings.key_timeout)
        # the joystick: forward, left, counter-clockwise
        self.stick: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self.note = ""
        self._stopping: float | None = None  # when the stop in progress began
        self._speeds: dict[str, tuple[float, float]] = {}  # of the other robots
        self._robot = ""

    @property
    def motion(self) -> Deflection:
        """The combined motion of the held keys, or without any that of the joystick."""
        keys = self.key_state.keys
        if self.settings.deadman and DEAD_MAN not in keys and keys:
            return STILL
        moves = [self.layout.moves[key] for key in keys if key in self.layout.moves]
        forward, left, turn = self.stick
        return combined(moves) if moves else (forward, left, 0.0, turn)

    @property
    def engaged(self) -> bool:
        """Whether a key drives or a stop is in progress."""
        return self.motion != STILL or self._stopping is not None

    def key(self, key: Key) -> str:
        """The key of the layout that was pressed."""
        return self.layout.key_for(key.name, key.base)

    def take(self, key: Key, now: float) -> str:
        """Take a key event. Returns the requested action, such as "resume", or "". Unknown keys
        stop the robot.
        """
        name = self.key(key)
        if key.kind == "release":
            return self._moved(lambda: self.key_state.release(key.code), now)
        action = ""
        if name in self.layout.speeds:
            self.scale(*self.layout.speeds[name])
        elif key.kind != "repeat":
            action = self._press(name, key, now)
        if key.kind == "typed" and name not in self.layout.moves and name not in PIECES:
            self.key_state.interrupt(name, now)
        return action

    def disregard(self, key: Key, now: float) -> None:
        """Take a key that does not count; neither do its repeats."""
        if key.kind == "typed" and key.name not in PIECES:
            self.key_state.ignore(self.key(key), now)

    def let_go(self) -> None:
        """Release all keys and the joystick."""
        self.key_state.let_go()
        self.stick = (0.0, 0.0, 0.0)

    def stop(self, now: float) -> None:
        """Release everything, and begin a stop."""
        self.let_go()
        self._stopping = now

    def expire(self, now: float) -> bool:
        """Release a key that no longer repeats; returns whether that changed the motion."""
        before = self.motion
        if expired := self.key_state.expire(now):
            self._settle(before != STILL, now)
        return expired and self.motion != before

    def steer(self, stick: tuple[float, float, float], now: float) -> None:
        """Take the joystick's position."""
        moved = self.motion != STILL
        self.stick = stick
        self._settle(moved, now)

    def scale(self, speed: float, turn: float | None = None) -> None:
        """Multiply the speed and the turn (by default by the same factor), up to their limits."""
        turn = speed if turn is None else turn
        now = self.settings
        wanted = now.speed * speed, now.turn * turn
        self.settings = replace(
            now, speed=min(now.speed_limit, wanted[0]), turn=min(now.turn_limit, wanted[1])
        )
        over = [
            name
            for name, value in zip(("speed", "turn"), wanted, strict=True)
            if value > getattr(now, f"{name}_limit")
        ]
        self.note = f"limit of {' and '.join(over)} reached" if over else ""

    def command(self, now: float, rests: bool) -> Twist | None:
        """The command to publish at `now`, or None. `rests`: an odom after the stop shows no
        motion.
        """
        self.expire(now)
        if self._stopping is not None and (now - self._stopping > STOP_FOR or rests):
            self._stopping = None
        return self._twist() if self.engaged else None

    def stopping_since(self) -> float | None:
        """When the stop in progress began; None if there is none."""
        return self._stopping

    def switch(self, robot: str) -> None:
        """Switch to another robot, with the speeds it had before."""
        self._speeds[self._robot] = self.settings.speed, self.settings.turn
        speed, turn = self._speeds.get(robot, self._speeds[self._robot])
        self.settings, self._robot = replace(self.settings, speed=speed, turn=turn), robot

    def _press(self, name: str, key: Key, now: float) -> str:
        if action := self.layout.actions.get(name):
            if action == "stop" and not (self.settings.deadman and name == DEAD_MAN):
                self.stop(now)
                return ""
            if action != "stop":
                return action
        elif name not in self.layout.moves:
            self.stop(now)
            return ""
        return self._moved(lambda: self._hold(name, key, now), now)

    def _hold(self, name: str, key: Key, now: float) -> None:
        if key.kind == "press":
            self.key_state.press(name, key.code)
        else:
            self.key_state.type(name, now)

    def _moved(self, change: Callable[[], object], now: float) -> str:
        moved = self.motion != STILL
        change()
        self._settle(moved, now)
        return ""

    def _settle(self, moved: bool, now: float) -> None:
        """After a change: begin a stop if the motion ended; cancel it if there is motion."""
        if self.motion != STILL:
            self._stopping = None
        elif moved:
            self._stopping = now

    def _twist(self) -> Twist:
        x, y, z, turn = self.motion
        speed = self.settings.speed
        return Twist(
            Vector3(x * speed, y * speed, z * speed), Vector3(0.0, 0.0, turn * self.settings.turn)
        )


def combined(moves: list[Direction]) -> Deflection:
    """The sum of several keys' motions, no faster in the plane than one of them. A single key
    counts unchanged.
    """
    x, y, z, turn = (max(-1.0, min(1.0, float(sum(axis)))) for axis in zip(*moves, strict=True))
    scale = max(1.0, math.hypot(x, y)) if len(moves) > 1 else 1.0
    return x / scale, y / scale, z, turn
