"""Linux input devices: the few structs and ioctls of linux/input.h that a gamepad needs.

Read by hand, so that nothing has to be compiled or installed: this interface of the kernel never changes.
"""

import fcntl
import os
import struct
from collections.abc import Iterator

EV_SYN, EV_KEY, EV_ABS = 0x00, 0x01, 0x03
SYN_REPORT, SYN_DROPPED = 0, 3

Event = tuple[int, int, int]
"""Type, code, value."""

Range = tuple[int, int]
"""An axis' lowest and highest value."""

EVENT = struct.Struct("llHHi")  # struct input_event: two of time, then type, code, value; 24 bytes on 64-bit machines
_ABSINFO = struct.Struct("6i")  # struct input_absinfo: value, minimum, maximum, fuzz, flat, resolution
_KEY_BYTES, _ABS_BYTES, _NAME_BYTES = 96, 8, 256  # for KEY_CNT and ABS_CNT bits, and for a name
_AT_ONCE = 64  # events


def request(number: int, size: int) -> int:
    """_IOC(_IOC_READ, 'E', number, size) of asm-generic/ioctl.h, which x86 and ARM use."""
    return 2 << 30 | size << 16 | ord("E") << 8 | number


NAME = request(0x06, _NAME_BYTES)  # EVIOCGNAME
KEYS_DOWN = request(0x18, _KEY_BYTES)  # EVIOCGKEY
KEYS = request(0x20 + EV_KEY, _KEY_BYTES)  # EVIOCGBIT
AXES = request(0x20 + EV_ABS, _ABS_BYTES)  # EVIOCGBIT
AXIS = request(0x40, _ABSINFO.size)  # EVIOCGABS, plus the axis


class Device:
    """An open input device. Every method raises OSError when it is unplugged, or is none."""

    def __init__(self, path: str) -> None:
        self._number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
        self._rest = b""

    def fileno(self) -> int:
        """The number for select; -1 when closed."""
        return self._number

    def close(self) -> None:
        """Let go of it; more than once does no harm."""
        number, self._number = self._number, -1
        if number >= 0:
            os.close(number)

    def name(self) -> str:
        """What its maker calls it."""
        return self._ask(NAME, _NAME_BYTES).split(b"\0")[0].decode(errors="replace")

    def keys(self) -> set[int]:
        """The codes of the keys and buttons that it has."""
        return _bits(self._ask(KEYS, _KEY_BYTES))

    def keys_down(self) -> set[int]:
        """The codes of those that are down now."""
        return _bits(self._ask(KEYS_DOWN, _KEY_BYTES))

    def axes(self) -> set[int]:
        """The codes of the axes that it has."""
        return _bits(self._ask(AXES, _ABS_BYTES))

    def axis(self, code: int) -> tuple[int, Range]:
        """An axis' value now, and its range."""
        value, low, high, *_ = _ABSINFO.unpack(self._ask(AXIS + code, _ABSINFO.size))
        return value, (low, high)

    def events(self) -> Iterator[Event]:
        """What waits to be read, oldest first. EOFError: there will be no more."""
        try:
            found = os.read(self._number, _AT_ONCE * EVENT.size)
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
        fcntl.ioctl(self._number, number, answer)
        return bytes(answer)


def _bits(found: bytes) -> set[int]:
    return {8 * index + bit for index, byte in enumerate(found) for bit in range(8) if byte >> bit & 1}
