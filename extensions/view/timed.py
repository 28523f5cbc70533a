"""Connections that know how old a message may be, by pings: for clients that echo no beats."""

import asyncio
import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import websockets.asyncio.server as websockets
from websockets.exceptions import ConnectionClosed
from websockets.frames import DATA_OPCODES, Frame, Opcode

PING_EVERY = 0.05  # s
DATE = 8  # bytes after a message that has a date
MAX_AGE = 0.3  # s; what may be older moves nothing, and ends no stop


def undated(data: bytes) -> tuple[bytes, float]:
    """A message without its date, and the time (s, monotonic) since which it was sent."""
    return data[:-DATE], int.from_bytes(data[-DATE:], "little") * 1e-9


@dataclass
class Limits:
    """What becomes of the messages of a connection.

    Attributes:
        moves: Whether the data of a frame may move a robot. Such a message is dropped if it may be
            older than MAX_AGE.
        dates: Whether it gets a date instead, which `undated` takes off: the time (ns, monotonic,
            little-endian) since which it was sent.
    """

    moves: Callable[[bytes], bool]
    dates: Callable[[bytes], bool]


class TimedConnection(websockets.ServerConnection):
    """A connection that knows an upper bound of the age of each message. A browser answers pings in
    the order of what it sends, so a message was sent after the last ping that was answered before
    it arrived.
    """

    def __init__(self, limits: Limits, *parts: Any, **options: Any) -> None:
        super().__init__(*parts, **options)
        self._limits, self._answered = limits, time.monotonic()
        self._date = b""  # of the message that arrives; empty if it gets none

    async def ping_often(self) -> None:
        """Send pings for as long as the connection lasts."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self.ping(b"%x" % time.monotonic_ns())
                await asyncio.sleep(PING_EVERY)

    def process_event(self, event: Any) -> None:
        """Take a frame. One that may move a robot is dropped if it may be older than MAX_AGE."""
        now = time.monotonic()
        if isinstance(event, Frame):
            if event.opcode is Opcode.PONG and bytes(event.data) in self.pending_pings:
                with contextlib.suppress(ValueError):  # the library's own pings hold no time
                    self._answered = max(self._answered, int(bytes(event.data), 16) * 1e-9)
            if event.opcode in DATA_OPCODES and not self._counts(event, now):
                return
        super().process_event(event)

    def _counts(self, frame: Frame, now: float) -> bool:
        """Whether a frame of data counts. The date of its message goes after the last frame."""
        if frame.opcode is not Opcode.CONT:
            has_date = self._limits.dates(bytes(frame.data))
            self._date = int(self._answered * 1e9).to_bytes(DATE, "little") if has_date else b""
        if self._date:
            frame.data = bytes(frame.data) + self._date * frame.fin
        elif now - self._answered > MAX_AGE and self._limits.moves(bytes(frame.data)):
            return False
        return True
