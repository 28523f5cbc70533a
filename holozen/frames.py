"""The frames that transforms connect: where one is in another."""

from __future__ import annotations

from typing import TYPE_CHECKING

from holozen.bus import Bus
from holozen.rotation import Transform
from holozen.suggest import listed, suggest
from holozen.wire import key_for

if TYPE_CHECKING:
    from holozen.messages import TFMessage

WAITING = 256  # messages of transforms
LARGEST = 1_000_000  # bytes of a message of transforms


class Frames:
    """The latest transform from each frame to its parent. Metres, radians, seconds."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Transform, float]] = {}  # by child; with the stamp, 0 for a static one

    def take(self, message: TFMessage, static: bool) -> None:
        """Take in a message of `tf` or `tf_static`."""
        for each in message.transforms:
            rigid = Transform.of(each.transform.translation, each.transform.rotation)
            self.put(each.header.frame_id, each.child_frame_id, rigid, 0.0 if static else each.header.stamp.seconds())

    def put(self, parent: str, child: str, at: Transform, stamp: float) -> None:
        """Take in where the frame `child` is in `parent`."""
        self._parents[child.removeprefix("/")] = parent.removeprefix("/"), at, stamp

    def names(self) -> list[str]:
        """All frames, sorted."""
        return sorted({*self._parents, *(parent for parent, _, _ in self._parents.values())})

    def lookup(self, source: str, target: str) -> tuple[Transform, float]:
        """The pose of `target` in the frame `source`, and the stamp of the newest transform between them.

        Raises LookupError with the reason.
        """
        for name in (source, target):
            if name not in (names := self.names()):
                raise LookupError(f"no frame {name!r}{suggest(name, names)}; frames: {listed(names)}")
        root, to_source, first = self._to_root(source)
        other, to_target, second = self._to_root(target)
        if root != other:
            raise LookupError(f"nothing connects {source!r} and {target!r}: their roots are {root!r} and {other!r}")
        return to_source.inverse() @ to_target, max(first, second)

    def _to_root(self, frame: str) -> tuple[str, Transform, float]:
        """The root above a frame, the frame's pose there, and the newest stamp on the way."""
        pose, newest, seen = Transform(), 0.0, {frame}
        while frame in self._parents:
            frame, rigid, stamp = self._parents[frame]
            if frame in seen:
                raise LookupError(f"the frames form a loop at {frame!r}")
            seen.add(frame)
            pose, newest = rigid @ pose, max(newest, stamp)
        return frame, pose, newest


class RobotFrames:
    """The frames of a live robot, by `tf` and `tf_static` below `namespace`, and by its odometry."""

    def __init__(self, bus: Bus, namespace: str, odometry: str) -> None:
        from holozen.messages import Odometry, TFMessage

        self._tree = Frames()
        self._tf = [
            bus.subscribe(key_for(key, namespace), TFMessage, depth=WAITING, limit=LARGEST)
            for key in ("tf", "tf_static")
        ]
        self._odometry = bus.state(odometry, Odometry)
        self.body = ""  # the frame that odometry moves
        self.root = ""  # the one in which it does

    def update(self) -> None:
        """Take in what has arrived."""
        for reader in self._tf:
            while received := reader.try_recv():
                if received.message:
                    self._tree.take(received.message, static=False)
        if (newest := self._odometry.try_recv()) and (odom := newest.message):
            at = Transform.of(odom.pose.pose.position, odom.pose.pose.orientation)
            self.root, self.body = (name.removeprefix("/") for name in (odom.header.frame_id, odom.child_frame_id))
            self._tree.put(self.root, self.body, at, odom.header.stamp.seconds())

    def names(self) -> list[str]:
        """All frames, sorted."""
        return self._tree.names()

    def of(self, frame: str, source: str = "") -> Transform | None:
        """Where a frame is in another, by default that of the robot's body; None if no transforms lead there."""
        try:
            return self._tree.lookup(source or self.body, frame.removeprefix("/"))[0]
        except LookupError:
            return None

    def close(self) -> None:
        """Stop listening."""
        for reader in self._tf:
            reader.close()
        self._odometry.close()
