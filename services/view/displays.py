"""What RViz calls displays, of the robot that a page has chosen: its frames, and what its topics hold in them."""

import io
import math
from array import array
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import viser

from holozen.bus import Bus, Subscription
from holozen.frames import RobotFrames
from holozen.messages import (
    CompressedImage,
    Image,
    LaserScan,
    Message,
    Odometry,
    Path,
    PointCloud2,
    PointField,
    Range,
)
from holozen.rotation import Transform
from holozen.wire import key_for

from .scene import SEEN, Scene, Shown, wxyz

KINDS: dict[str, type[Message]] = {
    kind.ROS: kind for kind in (LaserScan, PointCloud2, Range, Image, CompressedImage, Path, Odometry)
}
WORLD = "world"  # the fixed frame in which robots are where they truly are
DRAW_EVERY = 4  # frames of the page
LARGEST = 16_000_000  # bytes of a message that is shown
RED, YELLOW, GREEN, BLUE = (230, 0, 0), (235, 200, 0), (0, 150, 0), (0, 90, 220)
POINT = 0.02  # m
LINE = 0.015  # m
AXES = 0.25  # m
ELLIPSE = 32  # points
WIDEST = 1e4  # m^2; the variance of what is not known
NUMPY = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}
PICTURES = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}
"""The channels of the encodings with a byte for each; others are depths."""
DEPTHS = {"32FC1": "f4", "16UC1": "u2"}


Place = viser.GuiFolderHandle | viser.GuiTabHandle
"""Where in the panel."""


class Display:
    """The newest message of a topic, drawn in its frame below the node `root`, which is the frame `fixed` (empty: the
    robot's body), or in the panel.
    """

    def __init__(
        self, client: viser.ClientHandle, place: Place, bus: Bus, frames: RobotFrames, root: str, fixed: str, key: str,
        kind: str,
    ) -> None:  # fmt: skip
        self._client, self._place, self._frames, self._fixed, self._key = client, place, frames, fixed, key
        self.kind = kind
        self._path = f"{root}/displays/{key.replace('/', '_')}"
        self._reader: Subscription[Any] = bus.subscribe(key, KINDS[kind], depth=1, limit=LARGEST)
        self._handles: list[Any] = []
        self.problem = "no message"

    def update(self) -> None:
        """Draw what has arrived."""
        received = self._reader.try_recv()
        if received is None:
            return
        if received.message is None:
            self.problem = received.error
            return
        message = received.message
        is_picture = isinstance(message, Image | CompressedImage)
        at = self._frames.of(message.header.frame_id, self._fixed)
        if at is None and not is_picture:
            to = self._fixed or self._frames.body
            self.problem = f"no transform from {message.header.frame_id or 'no frame'} to {to}"
            return
        self.problem = ""
        if is_picture:
            self._draw_image(message)
        else:
            self._draw(message, at or Transform())

    def close(self) -> None:
        """Take it out of the page."""
        self._reader.close()
        for handle in self._handles:
            handle.remove()

    def _draw_image(self, image: Image | CompressedImage) -> None:
        pixels = picture(image) if isinstance(image, Image) else decompressed(image)
        if pixels is None:
            if isinstance(image, Image):
                self.problem = f"images of {image.width} x {image.height} {image.encoding!r} are not shown"
            else:
                self.problem = f"{len(image.data)} bytes of {image.format!r} are no JPEG or PNG that is shown"
        elif self._handles:
            self._handles[0].image = pixels
        else:
            with self._place:
                self._handles.append(self._client.gui.add_image(pixels, label=self._key, format="jpeg"))

    def _draw(self, message: Any, at: Transform) -> None:
        add = self._client.scene
        if isinstance(message, LaserScan | PointCloud2):
            points = scan_points(message) if isinstance(message, LaserScan) else cloud_points(message)
            handle: Any = add.add_point_cloud(self._path, points, RED, point_size=POINT, precision="float32")
        elif isinstance(message, Range):
            handle = add.add_line_segments(self._path, segments(fan(message)), BLUE, thickness=LINE)
        elif isinstance(message, Path):
            line = [(one.pose.position.x, one.pose.position.y, one.pose.position.z) for one in message.poses]
            handle = add.add_line_segments(self._path, segments(np.array(line)), GREEN, thickness=LINE)
        else:
            handle = add.add_line_segments(self._path, segments(ellipse(message)), YELLOW, thickness=LINE)
        handle.position, handle.wxyz = at.translation, wxyz(at.rotation)
        self._handles = [handle]  # one of the same name has taken the place of the last


class Displays:
    """The displays of one page. `chosen` is its robot."""

    def __init__(
        self, client: viser.ClientHandle, place: Place, bus: Bus, scene: Scene, chosen: Callable[[], Shown | None]
    ) -> None:
        self._client, self._place, self._bus, self._scene, self._chosen = client, place, bus, scene, chosen
        self._frames: RobotFrames | None = None
        self._robot: Shown | None = None
        self._topics: Mapping[str, str] = {}
        self._boxes: list[Any] = []
        self._on: dict[str, Display] = {}
        self._axes: dict[str, tuple[Any, Transform]] | None = None
        self._updates = 0
        with place:
            self._fixed = client.gui.add_dropdown("Fixed frame", [WORLD], hint="the frame in which displays are drawn")
            self._problems = client.gui.add_markdown("")

        async def changed(_event: Any) -> None:
            self._draw_anew()

        self._fixed.on_update(changed)

    def update(self) -> None:
        """Draw what is switched on, of the robot that is chosen now."""
        if self._chosen() is not self._robot or self._scene.topics is not self._topics:
            self._offer()
        self._updates += 1
        if self._updates % DRAW_EVERY or not self._frames:
            return
        self._frames.update()
        if (
            names := tuple(dict.fromkeys((WORLD, *self._frames.names())))
        ) != self._fixed.options and self._fixed.value in names:
            self._fixed.options = names
        for display in self._on.values():
            display.update()
        if self._axes is not None and self._robot:
            self._draw_axes(self._frames, f"{self._root}/displays/tf")
        problems = "  \n".join(f"{key}: {one.problem}" for key, one in self._on.items() if one.problem)
        if problems != self._problems.content:
            self._problems.content = problems

    def close(self) -> None:
        """Stop listening."""
        for key in list(self._on):
            self._switch(key, "", False)
        if self._axes:
            self._switch_axes(False)
        if self._frames:
            self._frames.close()
        self._frames = None

    @property
    def _root(self) -> str:
        """The node that is the fixed frame: a robot's own, or the origin of the world."""
        assert self._robot
        return self._robot.root if self._fixed.value == WORLD else f"/fixed{self._robot.root}"

    def _draw_anew(self) -> None:
        """Draw everything in the fixed frame that was chosen."""
        for key, display in list(self._on.items()):  # also of a topic that has gone
            self._switch(key, display.kind, True)
        if self._axes is not None:
            self._switch_axes(False)
            self._switch_axes(True)

    def _offer(self) -> None:
        """A box for each topic of the robot; what was on stays on while it is the same robot."""
        robot, self._topics = self._chosen(), self._scene.topics
        if robot is not self._robot:
            self.close()
            self._fixed.options = (WORLD,)
        self._robot = robot
        for box in self._boxes:
            box.remove()
        self._boxes = []
        if robot is None:
            return
        entity = robot.entity
        place, odometry = entity.command.rpartition("/")[0], entity.odometry or key_for("odom", entity.name)
        self._frames = self._frames or RobotFrames(self._bus, place, odometry)
        others = {shown.entity.command.rpartition("/")[0] for shown in self._scene.shown.values()} - {place, ""}
        with self._place:
            self._box("TF", self._axes is not None, self._switch_axes)
            for key, kind in self._topics.items():
                is_own = key.startswith(f"{place}/") if place else key.partition("/")[0] not in others
                if kind in KINDS and is_own:
                    switch = partial(self._switch, key, kind)
                    self._box(f"{KINDS[kind].__name__}: {key}", key in self._on, switch)

    def _box(self, label: str, is_on: bool, switch: Callable[[bool], None]) -> None:
        box = self._client.gui.add_checkbox(label, is_on)

        async def changed(_event: Any) -> None:
            switch(box.value)

        box.on_update(changed)
        self._boxes.append(box)

    def _switch(self, key: str, kind: str, is_on: bool) -> None:
        if display := self._on.pop(key, None):
            display.close()
        if is_on and self._frames and self._robot:
            fixed = "" if self._fixed.value == WORLD else self._fixed.value
            self._on[key] = Display(self._client, self._place, self._bus, self._frames, self._root, fixed, key, kind)

    def _switch_axes(self, is_on: bool) -> None:
        for handle, _ in (self._axes or {}).values():
            handle.remove()
        self._axes = {} if is_on else None

    def _draw_axes(self, frames: RobotFrames, path: str) -> None:
        axes, add = self._axes, self._client.scene
        for name in frames.names():
            fixed = "" if self._fixed.value == WORLD else self._fixed.value
            if axes is None or (at := frames.of(name, fixed)) is None:
                continue
            handle, before = axes.get(name, (None, at))
            if handle is None:
                node = f"{path}/{name.replace('/', '_')}"
                handle = add.add_frame(node, axes_length=AXES, axes_radius=AXES / 25)
                add.add_label(f"{node}/name", name)
            elif max(map(abs, np.subtract(at.translation + at.rotation, before.translation + before.rotation))) < SEEN:
                continue
            handle.position, handle.wxyz = at.translation, wxyz(at.rotation)
            axes[name] = handle, at


def scan_points(scan: LaserScan) -> Any:
    """The points (n, 3) that a scan has hit, in m in its frame."""
    ranges = np.asarray(scan.ranges, float)
    hit = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    return np.stack((ranges * np.cos(angles), ranges * np.sin(angles), 0 * angles), axis=1)[hit].astype(np.float32)


def cloud_points(cloud: PointCloud2) -> Any:
    """The finite points (n, 3) of a cloud, in m in its frame; none if it has no x, y and z."""
    fields = {field.name: field for field in cloud.fields}
    if not all(name in fields and fields[name].datatype in NUMPY for name in "xyz") or not cloud.point_step:
        return np.zeros((0, 3), np.float32)
    order = ">" if cloud.is_bigendian else "<"
    kind = np.dtype({
        "names": ["x", "y", "z"], "formats": [order + NUMPY[fields[name].datatype] for name in "xyz"],
        "offsets": [fields[name].offset for name in "xyz"], "itemsize": cloud.point_step,
    })  # fmt: skip
    data = np.asarray(cloud.data, np.uint8).tobytes()
    points = np.frombuffer(data, kind, len(data) // cloud.point_step)
    found = np.stack([points[name] for name in "xyz"], axis=1).astype(np.float32)
    return found[np.isfinite(found).all(axis=1)]


def picture(image: Image) -> Any:
    """An image's pixels (height, width, 3) as red, green and blue, depths from near (bright) to far; None if it cannot
    be shown.
    """
    shape, data = (image.height, image.width), np.asarray(image.data, np.uint8)
    if channels := PICTURES.get(image.encoding):
        if data.size != math.prod(shape) * channels or not data.size:
            return None
        pixels = data.reshape(*shape, channels)
        if channels == 1:
            return np.repeat(pixels, 3, axis=2)
        return np.ascontiguousarray(pixels[:, :, 2::-1] if image.encoding.startswith("bgr") else pixels[:, :, :3])
    if image.encoding in DEPTHS:
        kind = np.dtype((">" if image.is_bigendian else "<") + DEPTHS[image.encoding])
        if data.size != math.prod(shape) * kind.itemsize or not data.size:
            return None
        depths = data.view(kind).reshape(shape).astype(float)
        known = np.isfinite(depths) & (depths > 0)
        farthest = depths[known].max() if known.any() else 1.0
        grey = np.where(known, 255 * (1 - 0.9 * depths / farthest), 0).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)
    return None


def decompressed(image: CompressedImage) -> Any:
    """The pixels (height, width, 3) of a JPEG or PNG; None if it is neither, or too large."""
    from PIL import Image as Pictures  # comes with viser

    try:
        with Pictures.open(io.BytesIO(bytes(image.data)), formats=("JPEG", "PNG")) as found:
            if 3 * math.prod(found.size) > LARGEST:
                return None
            if not found.mode.startswith("I"):
                return np.asarray(found.convert("RGB"))
            depths = np.asarray(found).astype("<u2")  # 16 bits
            data = array("B", depths.tobytes())
            return picture(Image(height=found.height, width=found.width, encoding="16UC1", data=data))
    except (OSError, ValueError, SyntaxError, Pictures.DecompressionBombError):
        return None


def fan(measured: Range) -> Any:
    """The outline (n, 3) of what a distance sensor sees, up to what it has hit, in m in its frame: to its limit where
    nothing is near (inf), its nearest where something is too near (-inf); empty if it has not measured.
    """
    distance = min(max(measured.range, measured.min_range), measured.max_range)
    if math.isnan(measured.range) or not math.isfinite(distance) or not math.isfinite(measured.field_of_view):
        return np.zeros((0, 3))
    turn = np.linspace(-measured.field_of_view / 2, measured.field_of_view / 2, ELLIPSE)
    arc = np.stack((distance * np.cos(turn), distance * np.sin(turn), np.zeros_like(turn)), axis=1)
    return np.concatenate((np.zeros((1, 3)), arc, np.zeros((1, 3))))


def ellipse(odom: Odometry) -> Any:
    """The covariance of the position (n, 3) on the plane, one standard deviation wide, in m in the frame of odometry;
    empty if it is not known.
    """
    covariance = np.array(odom.pose.covariance, float).reshape(6, 6)[:2, :2]
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    if not np.isfinite(values).all() or values.max() <= 0 or values.max() > WIDEST:
        return np.zeros((0, 3))
    turn = np.linspace(0, 2 * np.pi, ELLIPSE + 1)
    flat = vectors @ (np.sqrt(np.maximum(values, 0))[:, None] * np.stack((np.cos(turn), np.sin(turn))))
    at = odom.pose.pose.position
    return np.stack((flat[0] + at.x, flat[1] + at.y, np.full_like(turn, at.z + LINE)), axis=1)


def segments(line: Any) -> Any:
    """The pieces (n, 2, 3) of a line of points."""
    points = np.asarray(line, np.float32).reshape(-1, 3)
    return np.stack((points[:-1], points[1:]), axis=1) if len(points) > 1 else np.zeros((0, 2, 3), np.float32)
