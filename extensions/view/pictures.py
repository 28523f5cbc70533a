"""The picture of a robot's camera, as JPEGs on a socket of their own: the newest wins, and the page
acknowledges each.

How large they are follows the link, by the time from a picture's sending to its acknowledgement.
H.264 by WebRTC would take a quarter of the bytes, and five more libraries with codecs; its jitter
buffer shows no age.
"""

import asyncio
import contextlib
import io
import math
import struct
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from holozen.bus import Bus, Subscription
from holozen.messages import CompressedImage, Image

from .displays import LARGEST, decompressed, picture
from .open_page import Page

HEADER = struct.Struct("<Idd")
"""Before each JPEG: its number; the newest time of the page's clock that had come when it was sent,
in ms; and its age from exposure to then, in s.
"""
LOOK = 0.005  # s between two looks for a picture
WINDOW = 2  # pictures that may be on their way, on a link without delay
MOST = 8  # on any link
# s that a picture may wait in the link; above, they become smaller, below, larger
SLOW, QUICK = (0.12, 0.04)
# quick pictures in a row after which they become larger, and slow ones after which smaller
CALM, BUSY = (15, 3)


class Size(NamedTuple):
    """How pictures are sent: the part of their width and height, and the quality of the JPEG."""

    scale: float
    quality: int


SIZES = [
    Size(1.0, 85),
    Size(1.0, 70),
    Size(1.0, 50),
    Size(0.7, 55),
    Size(0.5, 50),
    Size(0.35, 45),
    Size(0.25, 35),
]


class Link:
    """What the acknowledgements tell of a link. Pure; times in s."""

    def __init__(self) -> None:
        self._level, self._calm, self._busy = 1, 0, 0
        self._trips = deque[float](maxlen=100)
        self._period = 0.1
        self._last = -math.inf

    @property
    def size(self) -> Size:
        """How the next picture is sent."""
        return SIZES[self._level]

    @property
    def window(self) -> int:
        """How many pictures may be on their way."""
        least = min(self._trips, default=0.0)
        return min(MOST, WINDOW + math.floor(least / max(self._period, 0.01)))

    def sent(self, now: float) -> None:
        """A picture was sent."""
        if now - self._last < 1.0:
            self._period += 0.1 * (now - self._last - self._period)
        self._last = now

    def acknowledged(self, took: float) -> None:
        """A picture was acknowledged after so long."""
        self._trips.append(took)
        waited = took - min(self._trips)
        self._calm = self._calm + 1 if waited < QUICK else 0
        self._busy = self._busy + 1 if waited > SLOW else 0
        if self._busy >= BUSY and self._level < len(SIZES) - 1:
            self._level += 1
            self._busy = 0
        elif self._calm >= CALM and self._level:
            self._level -= 1
            self._calm = 0


def jpeg(message: Image | CompressedImage, size: Size) -> bytes:
    """A picture as JPEG; empty if it cannot be shown. One that is a JPEG already passes as it is at
    full size.
    """
    from PIL import Image as Pictures

    if isinstance(message, CompressedImage) and size == SIZES[0] and "jp" in message.format.lower():
        return bytes(message.data)
    pixels = picture(message) if isinstance(message, Image) else decompressed(message)
    if pixels is None:
        return b""
    made = Pictures.fromarray(pixels)
    if size.scale < 1:
        made = made.resize(
            (max(1, int(made.width * size.scale)), max(1, int(made.height * size.scale)))
        )
    file = io.BytesIO()
    made.save(file, "JPEG", quality=size.quality)
    return file.getvalue()


class Pictures:
    """The pictures of one page. `sent` returns the newest time of its clock that has come here, in
    ms.
    """

    def __init__(
        self,
        connection: ServerConnection,
        page: Page,
        bus: Bus,
        sent: Callable[[], float],
        work: ThreadPoolExecutor,
    ) -> None:
        self._connection, self._page, self._bus, self._sent, self._work = (
            connection,
            page,
            bus,
            sent,
            work,
        )
        self._link = Link()
        self._waiting: dict[
            int, float
        ] = {}  # the numbers of those on their way, and when they were sent (s)
        self._number = 0

    async def run(self) -> None:
        """Send pictures until the connection ends."""
        sending = asyncio.create_task(self._send())
        try:
            async for text in self._connection:
                now = time.monotonic()
                if (
                    isinstance(text, str)
                    and text.isdigit()
                    and (at := self._waiting.pop(int(text), None)) is not None
                ):
                    self._link.acknowledged(now - at)
        finally:
            sending.cancel()

    async def _send(self) -> None:
        reader: Subscription[Any] | None = None
        key: tuple[str, str] | None = None
        loop = asyncio.get_running_loop()
        try:
            with contextlib.suppress(ConnectionClosed):
                while True:
                    if self._page.camera != key:
                        if reader:
                            reader.close()
                        key, self._page.picture = self._page.camera, ""
                        kind = Image if key and key[1] == Image.ROS else CompressedImage
                        reader = (
                            self._bus.subscribe(key[0], kind, depth=1, limit=LARGEST)
                            if key
                            else None
                        )
                    if (
                        reader
                        and len(self._waiting) < self._link.window
                        and (received := reader.try_recv())
                    ):
                        at = time.monotonic()
                        message = received.message
                        self._page.picture = received.error
                        if message is not None:
                            found = await loop.run_in_executor(
                                self._work, jpeg, message, self._link.size
                            )
                            self._page.picture = (
                                "" if found else f"{key and key[0]}: this picture cannot be shown"
                            )
                            if found:
                                await self._put(found, self._age(message) + time.monotonic() - at)
                    await asyncio.sleep(LOOK)
        finally:
            if reader:
                reader.close()

    async def _put(self, found: bytes, age: float) -> None:
        self._number += 1
        now = time.monotonic()
        self._waiting[self._number] = now
        self._link.sent(now)
        await self._connection.send(HEADER.pack(self._number, self._sent(), age) + found)

    def _age(self, message: Image | CompressedImage) -> float:
        """Seconds from the exposure of a picture until it came here, by the clock of the robot,
        which its odometry tells; 0 if that is unknown.
        """
        driver, stamp = self._page.driver, message.header.stamp.seconds()
        odom, since = driver.odom.read() if driver else (None, math.inf)
        if odom is None or not stamp or since > 1.0:
            return 0.0
        return max(0.0, odom.header.stamp.seconds() + since - stamp)
