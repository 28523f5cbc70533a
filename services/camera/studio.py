"""All cameras of a sim: exposures in, pictures out."""

import io
import math
import threading
import time
import zlib
from array import array
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image as Jpeg

from holozen import engines
from holozen.bus import Bus, Publisher, Subscription
from holozen.console import report
from holozen.entities import description
from holozen.messages import CameraInfo, CompressedImage, Exposure, Header, Image
from holozen.messages.message import not_finite
from holozen.robot.errors import RobotError
from holozen.robot.files.description import read
from holozen.robot.files.sensors import FIELD_OF_VIEW, MAX_PIXELS
from holozen.transport.errors import BusError, ServiceError

from .picture import Bytes, Floats
from .rasterizer import Rasterizer
from .watch import Watch

if TYPE_CHECKING:
    from .renderer import Renderer

POLL = 0.005  # s between two looks for exposures
QUALITY = 80  # of a JPEG, from 1 to 95; image_transport's default
PATIENCE = 5.0  # s to wait for the description of an entity
ENCODINGS = ("rgb8", "mono8")
REPORT_EVERY = 1.0  # s between two lines about exposures that cannot be rendered


def renderer() -> "Renderer | Rasterizer":
    """A renderer: pybullet's where that is installed."""
    if not engines.is_installed(engines.PYBULLET):
        return Rasterizer()
    from .renderer import Renderer

    return Renderer()


class Studio:
    """All cameras of a sim. Of the exposures that arrived while a picture was rendered, only each
    camera's newest is rendered, and none of those that `watch` has dropped.
    """

    def __init__(
        self, bus: Bus, exposures: Subscription[Exposure], watch: Watch | None = None
    ) -> None:
        self._bus, self._exposures, self._renderer = bus, exposures, renderer()
        self._watch = watch or Watch()
        self._cameras: dict[str, Camera] = {}
        # entities not described yet: when that was requested (s), by number
        self._requested: dict[int, float] = {}
        self._reported = -math.inf  # s

    def run(self, stop: threading.Event) -> None:
        """Render until `stop` is set."""
        while not stop.is_set():
            waiting = [
                received.message
                for received in iter(self._exposures.try_recv, None)
                if received.message
            ]
            newest = dict[str, Exposure]()
            for exposure in waiting:
                name = exposure.image or exposure.depth
                newest[name] = exposure
                if not exposure.width and name in self._cameras:
                    self._cameras.pop(name).close()
            for name, exposure in newest.items():
                if exposure.width:
                    self._take(name, exposure)
            if not waiting:
                stop.wait(POLL)

    def _take(self, name: str, exposure: Exposure) -> None:
        if name in self._watch.dropped:
            return
        if reason := fault(exposure):
            return self._refuse(f"{name[:80]!r} cannot be rendered: {reason}")
        if name not in self._cameras:
            try:
                self._cameras[name] = Camera(self._bus, exposure)
            except BusError as error:
                return self._refuse(str(error))
        camera = self._cameras[name]
        if camera.poll_wanted():
            self._renderer.renew()
            self._request_descriptions(exposure)
            with self._watch.picture(name):
                camera.publish(exposure, self._renderer)

    def _refuse(self, reason: str) -> None:
        if (now := time.monotonic()) - self._reported >= REPORT_EVERY:
            report(f"camera: {reason}")
            self._reported = now

    def _request_descriptions(self, exposure: Exposure) -> None:
        """Request what new entities look like."""
        for entity in exposure.entities:
            asked = self._requested.get(entity.number, -math.inf)
            if (
                self._renderer.knows(entity.name, entity.number)
                or time.monotonic() - asked < PATIENCE
            ):
                continue
            now = time.monotonic()
            self._requested = {
                number: at for number, at in self._requested.items() if now - at < PATIENCE
            }
            self._requested[entity.number] = now
            try:
                if found := description(self._bus, entity.name, entity.number, PATIENCE):
                    self._renderer.add(entity.name, entity.number, read(found.description))
                    self._requested.pop(entity.number, None)
            except (ServiceError, RobotError) as error:
                report(f"camera: {entity.name} cannot be seen: {error}")


def fault(exposure: Exposure) -> str:
    """What is wrong with an exposure, which anyone may have sent; empty if it can be rendered."""
    low, high = FIELD_OF_VIEW
    if bad := not_finite(exposure):
        return f"{bad} is not a finite number"
    if not (exposure.info and (exposure.image or exposure.depth)):
        return "it has no key for its picture or its CameraInfo"
    if not 0 < exposure.width * exposure.height <= MAX_PIXELS:
        return (
            f"it has {exposure.width} x {exposure.height} pixels; from 1 to {MAX_PIXELS} are "
            "rendered"
        )
    if not low <= exposure.field_of_view <= high:
        return f"its field of view is {exposure.field_of_view:g} rad; use {low:g} to {high:g}"
    if not 0 < exposure.near < exposure.far:
        return f"near is {exposure.near:g} m and far {exposure.far:g} m; use 0 < near < far"
    if exposure.encoding not in ENCODINGS:
        return f"its encoding {exposure.encoding[:80]!r} is none of {', '.join(ENCODINGS)}"
    wrong = (one for one in exposure.entities if len(one.links) != len(one.poses))
    return next(
        (
            f"{one.name[:80]!r} has {len(one.links)} links and {len(one.poses)} poses"
            for one in wrong
        ),
        "",
    )


class Camera:
    """The publishers of a camera. Pictures are CDR whatever `--wire` says: in JSON one would take a
    second.
    """

    def __init__(self, bus: Bus, first: Exposure) -> None:
        self._image: Publisher[Image] | None = (
            bus.publisher(first.image, Image, wire="cdr") if first.image else None
        )
        self._compressed: Publisher[CompressedImage] | None = (
            bus.publisher(f"{first.image}/compressed", CompressedImage, wire="cdr")
            if first.image
            else None
        )
        self._depth: Publisher[Image] | None = (
            bus.publisher(first.depth, Image, wire="cdr") if first.depth else None
        )
        self._info: Publisher[CameraInfo] = bus.publisher(first.info, CameraInfo)
        self._all = [one for one in (self._image, self._compressed, self._depth, self._info) if one]

    def poll_wanted(self) -> bool:
        """Whether anyone wants what `publish` sends."""
        wanted = [one.poll_wanted() for one in self._all]
        return any(wanted)

    def close(self) -> None:
        """Close the keys."""
        for publisher in self._all:
            publisher.close()

    def publish(self, exposure: Exposure, renderer: "Renderer | Rasterizer") -> None:
        """Render and publish a picture."""
        if self._image or self._depth:
            colors, depth = renderer.render(exposure)
            if self._image and self._compressed:
                picture = _image(exposure, _with_noise(exposure, colors))
                self._image.put(picture)
                if self._compressed.poll_wanted():
                    self._compressed.put(_compressed(picture))
            if self._depth:
                self._depth.put(_image(exposure, depth))
        self._info.put(info(exposure))


def info(exposure: Exposure) -> CameraInfo:
    """The CameraInfo of a pinhole camera without distortion."""
    width, height = exposure.width, exposure.height
    focal = width / 2 / math.tan(exposure.field_of_view / 2)
    k = [focal, 0.0, width / 2, 0.0, focal, height / 2, 0.0, 0.0, 1.0]
    r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    p = [focal, 0.0, width / 2, 0.0, 0.0, focal, height / 2, 0.0, 0.0, 0.0, 1.0, 0.0]
    return CameraInfo(exposure.header, height, width, "plumb_bob", [0.0] * 5, k, r, p)


def _image(exposure: Exposure, pixels: Bytes | Floats) -> Image:
    height, width = pixels.shape[:2]
    encoding = "32FC1" if pixels.dtype == np.float32 else exposure.encoding
    if encoding == "mono8":  # ITU-R BT.601
        pixels = (pixels @ np.array([0.299, 0.587, 0.114])).round().astype(np.uint8)
    data = pixels.tobytes()
    header = Header(exposure.header.stamp, exposure.header.frame_id)
    return Image(header, height, width, encoding, 0, len(data) // height, array("B", data))


def _compressed(picture: Image) -> CompressedImage:
    """The JPEG of a picture."""
    color = picture.encoding != "mono8"
    file = io.BytesIO()
    pixels = Jpeg.frombytes(
        "RGB" if color else "L", (picture.width, picture.height), bytes(picture.data)
    )
    pixels.save(file, "JPEG", quality=QUALITY)
    # cv2 reads colours as bgr8
    name = f"{picture.encoding}; jpeg compressed {'bgr8' if color else ''}"
    return CompressedImage(picture.header, name, array("B", file.getvalue()))


def _with_noise(exposure: Exposure, colors: Bytes) -> Bytes:
    if not (exposure.noise_mean or exposure.noise_stddev):
        return colors
    stamp = exposure.header.stamp
    seed = (exposure.seed, zlib.crc32(exposure.image.encode()), stamp.sec, stamp.nanosec)
    noise = np.random.default_rng(seed).standard_normal(colors.shape, np.float32)
    noisy = colors + 255 * (exposure.noise_mean + exposure.noise_stddev * noise)
    return noisy.round().clip(0, 255).astype(np.uint8)
