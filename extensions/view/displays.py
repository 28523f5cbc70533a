"""Displays, as in RViz, of the robot that a page has chosen: its frames, and the messages of its
topics in them.
"""

import io
import math
from array import array
from collections.abc import Callable, Container, Iterator, Mapping
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

from .instances import difference, wxyz
from .scene import SEEN, Scene, Shown

KINDS: dict[str, type[Message]] = {
    kind.ROS: kind for kind in (LaserScan, PointCloud2, Range, Path, Odometry)
}
CAMERAS = (Image.ROS, CompressedImage.ROS)
WORLD = "world"  # the fixed frame in which a robot is at its true pose
DRAW_EVERY = 4  # frames of the page
LARGEST = 16_000_000  # bytes of a message that is shown
RED, YELLOW, GREEN, BLUE = (230, 0, 0), (235, 200, 0), (0, 150, 0), (0, 90, 220)
POINT = 0.02  # m
LINE = 0.015  # m
AXES = 0.25  # m
LABELLED = 6  # frames; of more of them the names are left out
ELLIPSE = 32  # points
WIDEST = 1e4  # m^2; a larger variance means that the position is unknown
NUMPY = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}
PICTURES = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1}
"""The number of channels in the encodings with a byte for each channel."""
DEPTHS = {"32FC1": "f4", "16UC1": "u2"}


class Display:
    """The newest message of a topic, drawn in its frame, below the node `root`, which is the frame
    `fixed` (empty: the robot's body).
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        bus: Bus,
        frames: RobotFrames,
        root: str,
        fixed: str,
        key: str,
        kind: str,
    ) -> None:
        self._client, self._frames, self._fixed = client, frames, fixed
        self._path = f"{root}/displays/{key.replace('/', '_')}"
        self._reader: Subscription[Any] = bus.subscribe(key, KINDS[kind], depth=1, limit=LARGEST)
        self._message: Any = None  # the newest that is drawn in a frame
        self._at = Transform()  # the pose in which it is drawn
        self._handles: list[Any] = []
        self.problem = "no message"

    def update(self) -> None:
        """Draw the newest message, if there is a transform to its frame."""
        received = self._reader.try_recv()
        if received:
            self.problem = received.error
            self._message = received.message or self._message
        if self._message is None:
            return
        frame = self._message.header.frame_id
        at = self._frames.of(frame, self._fixed)
        if at is None:
            self.problem = (
                f"no transform from {frame or 'no frame'} to {self._fixed or self._frames.body}"
            )
            self._erase()
        elif (received and received.message) or not self._handles:
            self.problem = ""
            self._draw(self._message, at)

    def follow(self) -> None:
        """As the robot moves, keep a message that is drawn below the robot's body in its own frame,
        such as a map's.
        """
        if self._handles and self._message and not self._fixed:
            at = self._frames.of(self._message.header.frame_id)
            if at is not None and difference(at, self._at) > SEEN:
                self._put(at)

    def close(self) -> None:
        """Remove it from the page."""
        self._reader.close()
        self._erase()

    def forget(self) -> None:
        """The scene is gone, and with it all that was drawn there."""
        self._reader.close()
        self._handles = []

    def _erase(self) -> None:
        for handle in self._handles:
            handle.remove()
        self._handles = []

    def _put(self, at: Transform) -> None:
        self._at, (handle,) = at, self._handles
        handle.position, handle.wxyz = at.translation, wxyz(at.rotation)

    def _draw(self, message: Any, at: Transform) -> None:
        if isinstance(message, LaserScan | PointCloud2):
            points, color = (
                scan_points(message) if isinstance(message, LaserScan) else cloud_points(message),
                RED,
            )
        elif isinstance(message, Range):
            points, color = segments(fan(message)), BLUE
        elif isinstance(message, Path):
            line = [
                (one.pose.position.x, one.pose.position.y, one.pose.position.z)
                for one in message.poses
            ]
            points, color = segments(np.array(line)), GREEN
        else:
            points, color = segments(ellipse(message)), YELLOW
        add = self._client.scene
        # a new node would begin to be shown again, and never be if the next one replaced it
        if self._handles:
            self._handles[0].points = points
        elif points.ndim == 2:
            cloud = add.add_point_cloud(
                self._path, points, color, point_size=POINT, precision="float32"
            )
            self._handles.append(cloud)
        else:
            self._handles.append(add.add_line_segments(self._path, points, color, thickness=LINE))
        self._put(at)


class Displays:
    """The displays of one page. `chosen` returns its robot. They stay switched on while that, a
    frame, or the scene of the page is gone.

    Attributes:
        boxes: The displays that may be switched on, and whether they are.
        frames, frame: The frames that may be the fixed one, and the one that is.
        problems: A line for each.
    """

    def __init__(self, bus: Bus, scene: Scene, chosen: Callable[[], Shown | None]) -> None:
        self._bus, self._scene, self._chosen = bus, scene, chosen
        self._client: viser.ClientHandle | None = None
        self._frames: RobotFrames | None = None
        self._robot: Shown | None = None
        self._name = ""  # of the robot whose displays are switched on
        self._prefix = ""  # of its keys and frames, which labels leave out
        self._topics: Mapping[str, str] = {}
        self._offered: dict[
            str, tuple[str, str]
        ] = {}  # by label: key and type; of TF they are empty
        self._on: dict[str, str] = {}  # the type of each topic that is switched on
        self._has_axes = False
        self._drawn: dict[str, Display] = {}
        self._axes: dict[str, tuple[Any, Transform]] = {}
        self._updates = 0
        self.frames: list[str] = [WORLD]
        self.frame = WORLD
        self.problems: list[str] = []

    @property
    def boxes(self) -> dict[str, bool]:
        """The displays that may be switched on, and whether they are."""
        return {
            label: key in self._on if key else self._has_axes
            for label, (key, _) in self._offered.items()
        }

    def join(self, client: viser.ClientHandle) -> None:
        """The scene of the page is there: draw in it."""
        self._forget()
        self._client = client
        self._redraw()

    def leave(self) -> None:
        """The scene of the page is gone."""
        self._client = None
        self._forget()

    def update(self) -> None:
        """Draw the displays that are switched on, of the robot that is chosen now."""
        if self._chosen() is not self._robot or self._scene.topics is not self._topics:
            self._offer()
        if self._frames:
            self._frames.update()
        for display in self._drawn.values():
            display.follow()
        self._updates += 1
        if self._updates % DRAW_EVERY == 0:
            self.problems = list(self._draw(self._frames)) if self._frames else []

    def switch(self, label: str, on: bool) -> None:
        """Switch a display on or off."""
        if label not in self._offered:
            return
        key, kind = self._offered[label]
        if not key:
            self._has_axes = on
            self._keep_axes(())
            return
        self._on.pop(key, None)
        if display := self._drawn.pop(key, None):
            display.close()
        if on:
            self._on[key] = kind
            self._add(key)

    def fix(self, frame: str) -> None:
        """Choose the fixed frame."""
        if frame in self.frames:
            self.frame = frame
            self._redraw()

    def close(self) -> None:
        """Stop listening."""
        self._erase()
        if self._frames:
            self._frames.close()
        self._frames = None

    @property
    def _root(self) -> str:
        """The node of the page that is the fixed frame: the robot's own, or one at the origin of
        the world.
        """
        assert self._robot
        return self._robot.root if self.frame == WORLD else f"/fixed{self._robot.root}"

    @property
    def _source(self) -> str:
        """The name of the fixed frame in tf; empty for the robot's body, whose pose in the world is
        known.
        """
        return "" if self.frame == WORLD else self.frame

    def _draw(self, frames: RobotFrames) -> Iterator[str]:
        """Draw everything. Yields a line for each problem."""
        there = frames.names()
        self.frames = list(dict.fromkeys((WORLD, *there, self.frame)))
        if self.frame not in (WORLD, *there):
            yield f"the frame {self.frame} is gone; what is drawn in it comes back with it"
        for key, one in self._drawn.items():
            one.update()
            if one.problem:
                yield f"{key.removeprefix(self._prefix)}: {one.problem}"
        if self._has_axes:
            self._draw_axes(frames)

    def _redraw(self) -> None:
        """Draw everything again, in the fixed frame that was chosen."""
        self._erase()
        for key in self._on:
            self._add(key)

    def _forget(self) -> None:
        """Let go of what was drawn in a scene that is gone."""
        for display in self._drawn.values():
            display.forget()
        self._drawn, self._axes = {}, {}

    def _erase(self) -> None:
        for display in self._drawn.values():
            display.close()
        for handle, _ in self._axes.values():
            handle.remove()
        self._drawn, self._axes = {}, {}

    def _offer(self) -> None:
        """Offer a display for each topic of the robot, and for those that are gone but switched
        on.
        """
        robot, self._topics = self._chosen(), self._scene.topics
        is_new, self._robot = robot is not self._robot, robot
        if is_new:
            self.close()
            self._offered = {}
        if robot is None:
            return
        entity = robot.entity
        if entity.name != self._name:
            self._name, self._on, self._has_axes = entity.name, {}, False
            self.frames, self.frame = [WORLD], WORLD
        place, odometry = (
            entity.command.rpartition("/")[0],
            entity.odometry or key_for("odom", entity.name),
        )
        self._prefix = key_for("", place)
        if is_new:
            self._frames = RobotFrames(self._bus, place, odometry)
            self._redraw()
        offered = {"TF": ("", "")}
        for key, kind in {**own_topics(self._scene, robot), **self._on}.items():
            if kind in KINDS:
                offered[f"{KINDS[kind].__name__}: {key.removeprefix(self._prefix)}"] = key, kind
        self._offered = offered

    def _add(self, key: str) -> None:
        if self._frames and self._robot and self._client:
            self._drawn[key] = Display(
                self._client, self._bus, self._frames, self._root, self._source, key, self._on[key]
            )

    def _draw_axes(self, frames: RobotFrames) -> None:
        if self._client is None:
            return
        add, path = self._client.scene, f"{self._root}/displays/tf"
        there = {
            name: at for name in frames.names() if (at := frames.of(name, self._source)) is not None
        }
        self._keep_axes(there)
        for name, at in there.items():
            handle, before = self._axes.get(name, (None, at))
            if handle is None:
                node = f"{path}/{name.replace('/', '_')}"
                handle = add.add_frame(node, axes_length=AXES, axes_radius=AXES / 25)
                if len(there) <= LABELLED:  # else they lie on each other
                    add.add_label(
                        f"{node}/name", name.removeprefix(self._prefix), font_screen_scale=0.7
                    )
            elif difference(at, before) <= SEEN:
                continue
            handle.position, handle.wxyz = at.translation, wxyz(at.rotation)
            self._axes[name] = handle, at

    def _keep_axes(self, names: Container[str]) -> None:
        """Remove the axes of all other frames from the page."""
        for name in [name for name in self._axes if name not in names]:
            self._axes.pop(name)[0].remove()


def own_topics(scene: Scene, robot: Shown) -> dict[str, str]:
    """The topics of a robot, and their types."""
    place = robot.entity.command.rpartition("/")[0]
    others = {shown.entity.command.rpartition("/")[0] for shown in list(scene.shown.values())} - {
        place,
        "",
    }

    def is_own(key: str) -> bool:
        return key.startswith(f"{place}/") if place else key.partition("/")[0] not in others

    return {key: kind for key, kind in scene.topics.items() if is_own(key)}


def scan_points(scan: LaserScan) -> Any:
    """The points (n, 3) that a scan has hit, in m, in its frame."""
    ranges = np.asarray(scan.ranges, float)
    hit = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    return np.stack((ranges * np.cos(angles), ranges * np.sin(angles), 0 * angles), axis=1)[
        hit
    ].astype(np.float32)


def cloud_points(cloud: PointCloud2) -> Any:
    """The finite points (n, 3) of a cloud, in m, in its frame; none if it lacks x, y or z, or if
    they do not fit into its points.
    """
    fields = {field.name: field for field in cloud.fields}
    if not all(name in fields and fields[name].datatype in NUMPY for name in "xyz"):
        return np.zeros((0, 3), np.float32)
    order = ">" if cloud.is_bigendian else "<"
    try:
        kind = np.dtype(
            {
                "names": ["x", "y", "z"],
                "formats": [order + NUMPY[fields[name].datatype] for name in "xyz"],
                "offsets": [fields[name].offset for name in "xyz"],
                "itemsize": cloud.point_step,
            }
        )
    except ValueError:  # the fields do not fit into a point
        return np.zeros((0, 3), np.float32)
    data = np.asarray(cloud.data, np.uint8).tobytes()
    points = np.frombuffer(data, kind, len(data) // cloud.point_step)
    found = np.stack([points[name] for name in "xyz"], axis=1).astype(np.float32)
    return found[np.isfinite(found).all(axis=1)]


def picture(image: Image) -> Any:
    """An image's pixels (height, width, 3) in red, green and blue; depths are shown from near
    (bright) to far (dark). None if it cannot be shown.
    """
    shape, data = (image.height, image.width), np.asarray(image.data, np.uint8)
    if channels := PICTURES.get(image.encoding):
        if data.size != math.prod(shape) * channels or not data.size:
            return None
        pixels = data.reshape(*shape, channels)
        if channels == 1:
            return np.repeat(pixels, 3, axis=2)
        return np.ascontiguousarray(
            pixels[:, :, 2::-1] if image.encoding.startswith("bgr") else pixels[:, :, :3]
        )
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
            return picture(
                Image(height=found.height, width=found.width, encoding="16UC1", data=data)
            )
    except (OSError, ValueError, SyntaxError, Pictures.DecompressionBombError):
        return None


def fan(measured: Range) -> Any:
    """The outline (n, 3) of a distance sensor's cone, up to what it has hit, in m, in its frame. If
    nothing is near (inf) it reaches to the greatest range, if something is too near (-inf) to the
    least; without a range it is empty.
    """
    distance = min(max(measured.range, measured.min_range), measured.max_range)
    if (
        math.isnan(measured.range)
        or not math.isfinite(distance)
        or not math.isfinite(measured.field_of_view)
    ):
        return np.zeros((0, 3))
    turn = np.linspace(-measured.field_of_view / 2, measured.field_of_view / 2, ELLIPSE)
    arc = np.stack((distance * np.cos(turn), distance * np.sin(turn), np.zeros_like(turn)), axis=1)
    return np.concatenate((np.zeros((1, 3)), arc, np.zeros((1, 3))))


def ellipse(odom: Odometry) -> Any:
    """The ellipse (n, 3) of the position's covariance in the plane, at one standard deviation, in
    m, in the frame of odometry; empty if the covariance is unknown.
    """
    covariance = np.array(odom.pose.covariance, float).reshape(6, 6)[:2, :2]
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    if not np.isfinite(values).all() or values.max() <= 0 or values.max() > WIDEST:
        return np.zeros((0, 3))
    turn = np.linspace(0, 2 * np.pi, ELLIPSE + 1)
    flat = vectors @ (
        np.sqrt(np.maximum(values, 0))[:, None] * np.stack((np.cos(turn), np.sin(turn)))
    )
    at = odom.pose.pose.position
    return np.stack((flat[0] + at.x, flat[1] + at.y, np.full_like(turn, at.z + LINE)), axis=1)


def segments(line: Any) -> Any:
    """The segments (n, 2, 3) of a line through points (n + 1, 3)."""
    points = np.asarray(line, np.float32).reshape(-1, 3)
    return (
        np.stack((points[:-1], points[1:]), axis=1)
        if len(points) > 1
        else np.zeros((0, 2, 3), np.float32)
    )
