"""Feetech's serial bus servos (STS3215) as wheels: commanded speeds out, measured speeds in. Linux,
without a library.

Packets and addresses are those of Feetech's protocol manual for the SMS and STS series. A speed is
in steps per second, with its sign in bit 15; a turn is 4096 steps.
"""

import math
import os
import select
import termios
import time
import tty
from collections.abc import Iterable, Mapping
from typing import Self

READ, WRITE, SYNC_WRITE = 2, 3, 0x83  # instructions
ALL = 0xFE  # the id of all servos, which none answers
MODE, TORQUE, GOAL_SPEED, SPEED = 33, 40, 46, 58  # addresses
SPEED_MODE = 1
STEPS = 4096 / math.tau  # a radian
ANSWER = 0.05  # s; a servo answers within 1 ms, a USB adapter or a busy computer delays that
TRIES = 3  # requests without an answer, after which a servo is taken to be gone
FIRST_TRIES = 20  # at the start, when nothing turns yet


class ServoError(Exception):
    """A servo did not answer, or the port is gone. The text is one line."""


def packet(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """The bytes of an instruction, or of an answer, which has its error code in place of the
    instruction.
    """
    body = bytes((servo, len(parameters) + 2, instruction)) + parameters
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))


def speed_bytes(rate: float) -> bytes:
    """A rate (rad/s) as the two bytes of a servo's speed."""
    steps = min(round(abs(rate) * STEPS), 0x7FFF)
    return (steps | (0x8000 if rate < 0 else 0)).to_bytes(2, "little")


def rate_of(value: bytes) -> float:
    """The rate (rad/s) in the two bytes of a servo's speed."""
    number = int.from_bytes(value, "little")
    return (number & 0x7FFF) / STEPS * (-1 if number & 0x8000 else 1)


class Servos:
    """The servos on a serial port such as /dev/ttyACM0, at 1 Mbit/s. Raises ServoError."""

    def __init__(self, port: str) -> None:
        self._port = port
        try:
            self._file = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_CLOEXEC)
            tty.setraw(self._file)
            modes = termios.tcgetattr(self._file)
            modes[4] = modes[5] = termios.B1000000
            termios.tcsetattr(self._file, termios.TCSANOW, modes)
        except (OSError, termios.error) as error:
            raise ServoError(f"cannot open {port}: {error.args[-1]}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        os.close(self._file)

    def make_wheels(self, servos: Iterable[int]) -> None:
        """Put servos into the mode in which they turn without end, at speed 0."""
        for servo in servos:
            for address, value in (
                (TORQUE, b"\0"),
                (MODE, bytes((SPEED_MODE,))),
                (GOAL_SPEED, b"\0\0"),
                (TORQUE, b"\1"),
            ):
                self._ask(servo, WRITE, bytes((address,)) + value, FIRST_TRIES)

    def turn(self, rates: Mapping[int, float]) -> None:
        """From now on, let servos turn at `rates` (rad/s). It does not wait for an answer."""
        values = b"".join(bytes((servo,)) + speed_bytes(rate) for servo, rate in rates.items())
        self._send(packet(ALL, SYNC_WRITE, bytes((GOAL_SPEED, 2)) + values))

    def rate(self, servo: int) -> float:
        """The rate (rad/s) at which a servo turns."""
        return rate_of(self._ask(servo, READ, bytes((SPEED, 2)), TRIES))

    def _ask(self, servo: int, instruction: int, parameters: bytes, tries: int) -> bytes:
        """The parameters of a servo's answer."""
        for _ in range(tries):
            if (answer := self._try(servo, instruction, parameters)) is not None:
                return answer
        raise ServoError(
            f"servo {servo} at {self._port} does not answer: is it powered, and is that its id?"
        )

    def _try(self, servo: int, instruction: int, parameters: bytes) -> bytes | None:
        """As `_ask`, once: None without an answer in time."""
        termios.tcflush(self._file, termios.TCIFLUSH)
        self._send(packet(servo, instruction, parameters))
        received, deadline = b"", time.monotonic() + ANSWER
        while True:
            start = received.find(bytes((0xFF, 0xFF, servo)))
            whole = received[start:] if start >= 0 else b""
            if len(whole) > 3 and len(whole) >= 4 + whole[3]:
                answer = whole[: 4 + whole[3]]
                if len(answer) < 6 or answer != packet(servo, answer[4], answer[5:-1]):
                    raise ServoError(f"servo {servo} at {self._port}: its answer is garbled")
                if answer[4]:
                    raise ServoError(
                        f"servo {servo} at {self._port} reports error {answer[4]:#04x}"
                    )
                return answer[5:-1]
            if not select.select([self._file], [], [], max(0.0, deadline - time.monotonic()))[0]:
                return None
            try:
                more = os.read(self._file, 256)
            except OSError as error:
                raise ServoError(f"{self._port}: {error.strerror}") from None
            if not more:
                raise ServoError(f"{self._port}: the port has hung up")
            received += more

    def _send(self, data: bytes) -> None:
        try:
            os.write(self._file, data)
        except OSError as error:
            raise ServoError(f"{self._port}: {error.strerror}") from None
