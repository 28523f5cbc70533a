"""A gamepad that Linux offers, for the pilot: where it points to, and what was pressed."""

import contextlib
import os
import re
from types import TracebackType

from holozen.tell import printable

from .evdev import Device
from .gamepad import ABS_HAT0Y, AXES, BUTTONS, Gamepad, Motion

FOLDER = "/dev/input"
MOST_READS = 16  # of 64 events each; what is left waits for the next time
GONE = (OSError, EOFError)
GROUP = "join the group that may: sudo usermod -aG input $USER, then log in anew"


class JoystickError(Exception):
    """There is no gamepad, or it is gone; the text is one line that says why."""

    def __init__(self, text: str) -> None:
        super().__init__(printable(text))


class _Forbidden(JoystickError):
    """It may not be opened."""


class Joystick:
    """An open gamepad, to be closed by `with`. The left shoulder button is the dead-man: nothing moves without it."""

    def __init__(self, device: Device, path: str) -> None:
        """Of an open device; OSError, or JoystickError if it is no gamepad."""
        self._device, self._path = device, path
        self.name = printable(device.name())
        axes = device.axes()
        missing = _missing(axes, device.keys())
        if missing:
            raise JoystickError(f"joystick {path}: {self.name!r} is no gamepad: it has no {', '.join(missing)}")
        self._axes = [axis for axis in (*AXES, ABS_HAT0Y) if axis in axes]
        ranges = {axis: device.axis(axis)[1] for axis in AXES}
        for axis, (low, high) in ranges.items():
            if low >= high:
                raise JoystickError(f"joystick {path}: {self.name!r} has no range for {AXES[axis]}: {low} to {high}")
        self._pad = Gamepad(ranges)
        self._begin()

    @classmethod
    def open(cls, device: str) -> "Joystick":
        """The gamepad at a path such as /dev/input/event7, or the first one if that is "". JoystickError."""
        return cls._at(device) if device else cls._first(FOLDER)

    def __enter__(self) -> "Joystick":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of it; it rests from then on."""
        self._pad.let_go()
        self._device.close()

    def fileno(self) -> int:
        """The number for select."""
        return self._device.fileno()

    @property
    def direction(self) -> Motion:
        """Forward, left, counter-clockwise, each -1..1, as of the last `read`; zeros unless the dead-man is held."""
        return self._pad.direction

    def let_go(self) -> None:
        """Rest until the dead-man was released and is pressed anew; what waits to be read counts no more.

        For a pilot that was stopped for a while: what was done with the pad meanwhile moves nothing.
        """
        self._pad.let_go()
        with contextlib.suppress(*GONE):  # the next `read` tells
            for _ in range(MOST_READS):
                if not list(self._device.events()):
                    break
            self._begin()

    def read(self) -> list[str]:
        """Take the events that wait; the actions that were pressed: "resume", "faster", "slower". Does not wait.

        JoystickError: it is gone; `direction` is zero from then on.
        """
        try:
            return self._read()
        except GONE:
            self._pad.let_go()
            raise JoystickError(f"joystick {self._path}: {self.name!r} is gone") from None

    def _read(self) -> list[str]:
        actions: list[str] = []
        for _ in range(MOST_READS):
            events = list(self._device.events())
            actions += [action for event in events if (action := self._pad.take(*event))]
            if self._pad.lost:
                self._begin()
            if not events:
                break
        return actions

    def _begin(self) -> None:
        """Read the state as it is now. Whether the dead-man is released is seen here as well."""
        values = {axis: self._device.axis(axis)[0] for axis in self._axes}
        self._pad.begin(values, self._device.keys_down())

    @classmethod
    def _at(cls, path: str) -> "Joystick":
        try:
            device = Device(path)
        except PermissionError:
            raise _Forbidden(f"joystick {path}: no permission; {GROUP}") from None
        except (OSError, ValueError) as error:
            raise JoystickError(f"joystick {path}: {getattr(error, 'strerror', None) or error}") from None
        with contextlib.ExitStack() as stack:
            stack.callback(device.close)
            try:
                made = cls(device, path)
            except OSError:
                raise JoystickError(f"joystick {path}: is no input device; use one of {FOLDER}/event*") from None
            stack.pop_all()
            return made

    @classmethod
    def _first(cls, folder: str) -> "Joystick":
        """The first gamepad in a folder; else one line says what there is."""
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
            raise JoystickError(f"joystick: no gamepad found, but {closed} of {len(paths)} devices in {folder} "
                                f"may not be read; {GROUP}")  # fmt: skip
        raise JoystickError(f"joystick: none of the {len(paths)} devices in {folder} is a gamepad")


def _devices(folder: str) -> list[str]:
    try:
        names = [name for name in os.listdir(folder) if re.fullmatch(r"event\d+", name)]
    except OSError:
        return []
    return [os.path.join(folder, name) for name in sorted(names, key=lambda name: int(name[5:]))]


def _missing(axes: set[int], buttons: set[int]) -> list[str]:
    """What a gamepad has and this device has not."""
    return [name for code, name in AXES.items() if code not in axes] + [
        name for code, name in BUTTONS.items() if code not in buttons
    ]
