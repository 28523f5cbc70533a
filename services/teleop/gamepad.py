"""Events of a gamepad -> where to go. Pure. Codes are those of the kernel's gamepad specification."""

import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet

from .evdev import EV_ABS, EV_KEY, EV_SYN, SYN_DROPPED, Range

ABS_X, ABS_Y, ABS_RX, ABS_HAT0Y = 0x00, 0x01, 0x03, 0x11
BTN_SOUTH, BTN_TL, BTN_START, BTN_DPAD_UP, BTN_DPAD_DOWN = 0x130, 0x136, 0x13B, 0x220, 0x221

AXES = {ABS_X: "ABS_X", ABS_Y: "ABS_Y", ABS_RX: "ABS_RX"}
"""The left stick, up being negative, and the right stick's x."""
BUTTONS = {BTN_SOUTH: "BTN_SOUTH", BTN_TL: "BTN_TL"}
"""What any gamepad has, and the left shoulder, which is the dead-man."""
DEADMAN = BTN_TL
PRESSES = {BTN_START: "resume", BTN_DPAD_UP: "faster", BTN_DPAD_DOWN: "slower"}
DEAD_ZONE = 0.15  # of a stick's way; worn sticks rest up to there

Motion = tuple[float, float, float]
"""Forward, left, counter-clockwise: each -1..1, the first two together at most 1 long."""
REST: Motion = (0.0, 0.0, 0.0)


class Gamepad:
    """The state of a gamepad's sticks and buttons. `ranges`: of the axes in AXES, each with low < high.

    It says where to go only while the dead-man is held, and only after it was seen released: a button that is stuck, or
    held down from before, does not drive.
    """

    def __init__(self, ranges: Mapping[int, Range]) -> None:
        self._ranges = dict(ranges)
        self._values: dict[int, int] = {}
        self._hat = 0
        self._armed = self._held = False
        self.lost = False
        """Events were lost: the state is unknown, and no event counts until it was read anew."""

    def begin(self, values: Mapping[int, int], down: AbstractSet[int]) -> None:
        """Start anew from the axes' values and the buttons that are down now."""
        self._values = dict(values)
        self._hat = self._values.get(ABS_HAT0Y, 0)
        self._armed, self._held = DEADMAN not in down, False
        self.lost = False

    def let_go(self) -> None:
        """Rest, until the dead-man was seen released and is pressed anew."""
        self._armed = self._held = False

    def take(self, kind: int, code: int, value: int) -> str:
        """Take an event; what it asks for: "resume", "faster", "slower" or nothing."""
        if kind == EV_SYN and code == SYN_DROPPED:
            self.let_go()
            self.lost = True
        if self.lost:
            return ""
        if kind == EV_ABS:
            return self._moved(code, value)
        return self._pressed(code, value) if kind == EV_KEY else ""

    @property
    def direction(self) -> Motion:
        """Where to go."""
        if not self._held:
            return REST
        x, y, turn = (self._fraction(axis) for axis in (ABS_X, ABS_Y, ABS_RX))
        forward, left = stick(-y, -x)
        return forward, left, stick(-turn, 0.0)[0]

    def _moved(self, code: int, value: int) -> str:
        self._values[code] = value
        if code != ABS_HAT0Y:
            return ""
        before, self._hat = self._hat, value
        return "" if value == before or not value else "faster" if value < 0 else "slower"

    def _pressed(self, code: int, value: int) -> str:
        if code == DEADMAN:
            self._armed = self._armed or not value
            self._held = self._armed and bool(value)
        return PRESSES.get(code, "") if value == 1 else ""  # 2 is a repeat

    def _fraction(self, axis: int) -> float:
        """An axis' place from -1 to 1."""
        low, high = self._ranges[axis]
        place = 2 * (self._values.get(axis, (low + high) / 2) - low) / (high - low) - 1
        return min(1.0, max(-1.0, place))


def stick(x: float, y: float) -> tuple[float, float]:
    """A stick's place -> the same direction, zero inside the dead zone, from there growing from 0 to a length of 1."""
    length = math.hypot(x, y)
    if length <= DEAD_ZONE:
        return 0.0, 0.0
    scale = min(1.0, (length - DEAD_ZONE) / (1 - DEAD_ZONE)) / length
    return x * scale, y * scale
