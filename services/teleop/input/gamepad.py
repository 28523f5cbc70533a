"""A Linux gamepad: its direction and its buttons.

The few structs and ioctls of linux/input.h, a stable interface of the kernel, are decoded here, so
that nothing has to be compiled or installed. Button and axis codes are those of the kernel's
gamepad specification.
"""

import contextlib
import errno
import fcntl
import math
import os
import re
import struct
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet

from holozen.console import printable

EV_SYN, EV_KEY, EV_ABS = 0x00, 0x01, 0x03
SYN_REPORT, SYN_DROPPED = 0, 3

Event = tuple[int, int, int]
"""Type, code, value."""

Range = tuple[int, int]
"""The lowest and highest value of an axis."""

# struct input_event: two of time, then type, code, value; 24 bytes on 64-bit machines
EVENT = struct.Struct("llHHi")
# struct input_absinfo: value, minimum, maximum, fuzz, flat, resolution
_ABSINFO = struct.Struct("6i")
_KEY_BYTES, _ABS_BYTES, _NAME_BYTES = 96, 8, 256  # for KEY_CNT and ABS_CNT bits, and for a name
_AT_ONCE = 64  # events


def request(number: int, size: int) -> int:
    """_IOC(_IOC_READ, 'E', number, size) of asm-generic/ioctl.h, which x86 and ARM use."""
    return 2 << 30 | size << 16 | ord("E") << 8 | number


GET_NAME = request(0x06, _NAME_BYTES)  # EVIOCGNAME
GET_KEYS_DOWN = request(0x18, _KEY_BYTES)  # EVIOCGKEY
GET_KEYS = request(0x20 + EV_KEY, _KEY_BYTES)  # EVIOCGBIT
GET_AXES = request(0x20 + EV_ABS, _ABS_BYTES)  # EVIOCGBIT
GET_AXIS = request(0x40, _ABSINFO.size)  # EVIOCGABS, plus the axis


class Device:
    """An open input device. Every method but `close` raises OSError if it is closed, unplugged or
    not an input device.
    """

    def __init__(self, path: str) -> None:
        flags = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
        self._descriptor: int | None = os.open(path, flags)  # None once it is closed
        self._rest = b""

    def fileno(self) -> int:
        """The file descriptor."""
        if self._descriptor is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return self._descriptor

    def close(self) -> None:
        """Close it; may be called repeatedly."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

    def name(self) -> str:
        """The manufacturer's name for it."""
        return self._ask(GET_NAME, _NAME_BYTES).split(b"\0")[0].decode(errors="replace")

    def keys(self) -> set[int]:
        """The codes of its keys and buttons."""
        return _bits(self._ask(GET_KEYS, _KEY_BYTES))

    def keys_down(self) -> set[int]:
        """The codes of those that are currently pressed."""
        return _bits(self._ask(GET_KEYS_DOWN, _KEY_BYTES))

    def axes(self) -> set[int]:
        """The codes of its axes."""
        return _bits(self._ask(GET_AXES, _ABS_BYTES))

    def axis(self, code: int) -> tuple[int, Range]:
        """The current value of an axis, and its range."""
        value, low, high, *_ = _ABSINFO.unpack(self._ask(GET_AXIS + code, _ABSINFO.size))
        return value, (low, high)

    def events(self) -> Iterator[Event]:
        """The pending events, oldest first. Raises EOFError if there will be no more."""
        try:
            found = os.read(self.fileno(), _AT_ONCE * EVENT.size)
        except BlockingIOError:
            return
        if not found:
            raise EOFError
        self._rest += found
        whole = len(self._rest) - len(self._rest) % EVENT.size
        complete, self._rest = self._rest[:whole], self._rest[whole:]
        for _, _, kind, code, value in EVENT.iter_unpack(complete):
            yield kind, code, value

    def _ask(self, number: int, size: int) -> bytes:
        answer = bytearray(size)
        fcntl.ioctl(self.fileno(), number, answer)
        return bytes(answer)


def _bits(found: bytes) -> set[int]:
    return {
        8 * index + bit for index, byte in enumerate(found) for bit in range(8) if byte >> bit & 1
    }


ABS_X, ABS_Y, ABS_RX, ABS_HAT0Y = 0x00, 0x01, 0x03, 0x11
BTN_SOUTH, BTN_TL, BTN_START, BTN_DPAD_UP, BTN_DPAD_DOWN = 0x130, 0x136, 0x13B, 0x220, 0x221

AXES = {ABS_X: "ABS_X", ABS_Y: "ABS_Y", ABS_RX: "ABS_RX"}
"""The left stick, where up is negative, and the right stick's x."""
BUTTONS = {BTN_SOUTH: "BTN_SOUTH", BTN_TL: "BTN_TL"}
"""The button that every gamepad has, and the left shoulder button, which is the dead-man."""
DEADMAN = BTN_TL
PRESSES = {BTN_START: "resume", BTN_DPAD_UP: "faster", BTN_DPAD_DOWN: "slower"}
DEAD_ZONE = 0.15  # of a stick's travel, since worn sticks do not rest at zero

Deflection = tuple[float, float, float]
"""Forward, left, counter-clockwise: each from -1 to 1, and the vector of the first two at most 1
long.
"""
REST: Deflection = (0.0, 0.0, 0.0)


class Gamepad:
    """The state of a gamepad's sticks and buttons. `ranges` are those of the axes in AXES, each
    with low < high.

    It has a direction only while the dead-man is held, and only after that was seen released: a
    button that is stuck, or held from the start, does not drive.
    """

    def __init__(self, ranges: Mapping[int, Range]) -> None:
        self._ranges = dict(ranges)
        self._values: dict[int, int] = {}
        self._hat = 0
        self._armed = self._held = False
        # whether events were lost: until the state is read again, events are ignored
        self.lost = False

    def begin(self, values: Mapping[int, int], down: AbstractSet[int]) -> None:
        """Restart from the current axis values and pressed buttons."""
        self._values = dict(values)
        self._hat = self._values.get(ABS_HAT0Y, 0)
        self._armed, self._held = DEADMAN not in down, False
        self.lost = False

    def let_go(self) -> None:
        """Rest until the dead-man is released and pressed again."""
        self._armed = self._held = False

    def take(self, kind: int, code: int, value: int) -> str:
        """Take an event; returns its action: "resume", "faster", "slower" or ""."""
        if kind == EV_SYN and code == SYN_DROPPED:
            self.let_go()
            self.lost = True
        if self.lost:
            return ""
        if kind == EV_ABS:
            return self._moved(code, value)
        return self._pressed(code, value) if kind == EV_KEY else ""

    @property
    def direction(self) -> Deflection:
        """The commanded direction."""
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
        """The position of an axis from -1 to 1."""
        low, high = self._ranges[axis]
        place = 2 * (self._values.get(axis, (low + high) / 2) - low) / (high - low) - 1
        return min(1.0, max(-1.0, place))


def stick(x: float, y: float) -> tuple[float, float]:
    """A stick's deflection without the dead zone: in the same direction, from 0 at the zone's edge
    to 1.
    """
    length = math.hypot(x, y)
    if length <= DEAD_ZONE:
        return 0.0, 0.0
    scale = min(1.0, (length - DEAD_ZONE) / (1 - DEAD_ZONE)) / length
    return x * scale, y * scale


FOLDER = "/dev/input"
MAX_READS = 16  # of up to 64 events each; the rest waits for the next call
GONE = (OSError, EOFError)
GROUP = "join the group that may: sudo usermod -aG input $USER, then log in again"


class JoystickError(Exception):
    """There is no gamepad, or it is gone; the text is one line with the reason."""

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


class _Forbidden(JoystickError):
    """No permission to open it."""


class Joystick:
    """An open gamepad, to be closed by `with`. The left shoulder button is the dead-man: nothing
    moves without it.
    """

    def __init__(self, device: Device, path: str) -> None:
        """Take an open device. Raises OSError, and JoystickError if it is not a gamepad."""
        self._device, self._path = device, path
        self.name = printable(device.name())
        axes = device.axes()
        missing = _missing(axes, device.keys())
        if missing:
            raise JoystickError(
                f"joystick {path}: {self.name!r} is not a gamepad: it has no {', '.join(missing)}"
            )
        self._axes = [axis for axis in (*AXES, ABS_HAT0Y) if axis in axes]
        ranges = {axis: device.axis(axis)[1] for axis in AXES}
        for axis, (low, high) in ranges.items():
            if low >= high:
                raise JoystickError(
                    f"joystick {path}: {self.name!r} has no range for {AXES[axis]}: {low} to {high}"
                )
        self._pad = Gamepad(ranges)
        self._begin()

    @classmethod
    def open(cls, device: str) -> "Joystick":
        """The gamepad at a path such as /dev/input/event7, or the first one if that is "". Raises
        JoystickError.
        """
        return cls._at(device) if device else cls._first(FOLDER)

    def __enter__(self) -> "Joystick":
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close it; it rests from then on."""
        self._pad.let_go()
        self._device.close()

    def fileno(self) -> int:
        """The file descriptor."""
        return self._device.fileno()

    @property
    def direction(self) -> Deflection:
        """Forward, left, counter-clockwise (-1 to 1) at the last `read`; zeros unless the dead-man
        is held.
        """
        return self._pad.direction

    def let_go(self) -> None:
        """Rest until the dead-man is released and pressed again, and drop pending events.

        Called after a stop, so that earlier input moves nothing.
        """
        self._pad.let_go()
        with contextlib.suppress(*GONE):  # the next `read` reports it
            for _ in range(MAX_READS):
                if not list(self._device.events()):
                    break
            self._begin()

    def read(self) -> list[str]:
        """Take the pending events, without blocking. Returns the requested actions: "resume",
        "faster", "slower".

        Raises JoystickError if it is gone; `direction` is zero from then on.
        """
        try:
            return self._read()
        except GONE:
            self._pad.let_go()
            raise JoystickError(f"joystick {self._path}: {self.name!r} is gone") from None

    def _read(self) -> list[str]:
        actions: list[str] = []
        for _ in range(MAX_READS):
            events = list(self._device.events())
            actions += [action for event in events if (action := self._pad.take(*event))]
            if self._pad.lost:
                self._begin()
            if not events:
                break
        return actions

    def _begin(self) -> None:
        """Read the current state, including whether the dead-man is released."""
        values = {axis: self._device.axis(axis)[0] for axis in self._axes}
        self._pad.begin(values, self._device.keys_down())

    @classmethod
    def _at(cls, path: str) -> "Joystick":
        try:
            device = Device(path)
        except PermissionError:
            raise _Forbidden(f"joystick {path}: no permission; {GROUP}") from None
        except (OSError, ValueError) as error:
            raise JoystickError(
                f"joystick {path}: {getattr(error, 'strerror', None) or error}"
            ) from None
        with contextlib.ExitStack() as stack:
            stack.callback(device.close)
            try:
                made = cls(device, path)
            except OSError:
                raise JoystickError(
                    f"joystick {path}: is not an input device; use one of {FOLDER}/event*"
                ) from None
            stack.pop_all()
            return made

    @classmethod
    def _first(cls, folder: str) -> "Joystick":
        """The first gamepad in a folder. Raises JoystickError, which describes the devices
        found.
        """
        paths = _devices(folder)
        closed = 0
        for path in paths:
            try:
                return cls._at(path)
            except JoystickError as error:
                closed += isinstance(error, _Forbidden)
        if not paths:
            raise JoystickError(f"joystick: no gamepad: there are no input devices in {folder}")
        if closed:
            raise JoystickError(
                f"joystick: no gamepad found, but {closed} of {len(paths)} "
                f"devices in {folder} "
                f"may not be read; {GROUP}"
            )
        raise JoystickError(f"joystick: none of the {len(paths)} devices in {folder} is a gamepad")


def _devices(folder: str) -> list[str]:
    try:
        names = [name for name in os.listdir(folder) if re.fullmatch(r"event\d+", name)]
    except OSError:
        return []
    return [os.path.join(folder, name) for name in sorted(names, key=lambda name: int(name[5:]))]


def _missing(axes: set[int], buttons: set[int]) -> list[str]:
    """The axes and buttons of a gamepad that this device lacks."""
    return [name for code, name in AXES.items() if code not in axes] + [
        name for code, name in BUTTONS.items() if code not in buttons
    ]
