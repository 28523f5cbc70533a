"""The frames that transforms connect: where one is in another."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from holozen.bus import Bus
from holozen.rotation import Transform
from holozen.suggest import listed, suggest
from holozen.wire import key_for

if TYPE_CHECKING:
    from holozen.messages import TFMessage

WAITING = 256  # queued messages of transforms
LARGEST = 1_000_000  # bytes of a message of transforms
SILENCE = 5.0  # s of a robot's time without an update of a frame, after which it is dropped


class Frames:
    """The latest transform from each frame to its parent. Metres, radians, seconds."""

    def __init__(self) -> None:
        # by child; with the stamp, 0 for a static one
        self._parents: dict[str, tuple[str, Transform, float]] = {}

    def take(self, message: TFMessage, static: bool) -> None:
        """Store the transforms of a message on `tf` or, if `static`, on `tf_static`."""
        for each in message.transforms:
            rigid = Transform.of(each.transform.translation, each.transform.rotation)
            self.put(
                each.header.frame_id,
                each.child_frame_id,
                rigid,
                0.0 if static else each.header.stamp.seconds(),
            )

    def put(self, parent: str, child: str, at: Transform, stamp: float) -> None:
        """Store the pose of the frame `child` in `parent`, and its stamp in s."""
        self._parents[child.removeprefix("/")] = parent.removeprefix("/"), at, stamp

    def drop(self, child: str) -> None:
        """Forget the pose of the frame `child`."""
        self._parents.pop(child, None)

    def names(self) -> list[str]:
        """All frames, sorted."""
        return sorted({*self._parents, *(parent for parent, _, _ in self._parents.values())})

    def lookup(self, source: str, target: str) -> tuple[Transform, float]:
        """The pose of `target` in the frame `source`, and the stamp of the newest transform between
        them.

        Raises LookupError with the reason.
        """
        for name in (source, target):
            if name not in (names := self.names()):
                raise LookupError(
                    f"no frame {name!r}{suggest(name, names)}; frames: {listed(names)}"
                )
        root, to_source, first = self._to_root(source)
        other, to_target, second = self._to_root(target)
        if root != other:
            raise LookupError(
                f"nothing connects {source!r} and {target!r}: their roots are {root!r} and "
                f"{other!r}"
            )
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


class Elapsed:
    """Elapsed time in s. Each update adds what passed by the clock or by a robot's stamps,
    whichever is less: nothing while a sim is paused, and little where the stamps jump, as in a bag
    or after a reset.
    """

    def __init__(self) -> None:
        self.total = 0.0
        self._now = self._stamp = math.inf

    def update(self, now: float, stamp: float) -> None:
        """It is `now` by the clock, and `stamp` by the robot's."""
        self.total += max(0.0, min(now - self._now, stamp - self._stamp))
        self._now, self._stamp = now, stamp


class RobotFrames:
    """The frames of a live robot, from `tf` and `tf_static` below `namespace`, and from the key
    `odometry`. A frame without updates on `tf` is dropped after SILENCE, as long as odometry
    arrives.
    """

    def __init__(self, bus: Bus, namespace: str, odometry: str) -> None:
        from holozen.messages import Odometry, TFMessage

        self._tree, self._elapsed = Frames(), Elapsed()
        self._heard: dict[str, float] = {}  # child -> when it was last updated, by `_elapsed`
        self._tf, self._static = [
            bus.subscribe(key_for(key, namespace), TFMessage, depth=WAITING, limit=LARGEST)
            for key in ("tf", "tf_static")
        ]
        self._odometry = bus.state(odometry, Odometry)
        self.body = ""  # the frame that odometry moves
        self.root = ""  # the one in which it does

    def update(self) -> None:
        """Read the messages that have arrived."""
        for reader, static in ((self._static, True), (self._tf, False)):
            while received := reader.try_recv():
                if received.message:
                    self._tree.take(received.message, static)
                    until = math.inf if static else self._elapsed.total
                    children = (
                        each.child_frame_id.removeprefix("/")
                        for each in received.message.transforms
                    )
                    self._heard.update(dict.fromkeys(children, until))
        if (newest := self._odometry.try_recv()) and (odom := newest.message):
            at = Transform.of(odom.pose.pose.position, odom.pose.pose.orientation)
            self.root, self.body = (
                name.removeprefix("/") for name in (odom.header.frame_id, odom.child_frame_id)
            )
            stamp = odom.header.stamp.seconds()
            self._tree.put(self.root, self.body, at, stamp)
            self._elapsed.update(time.monotonic(), stamp)
            self._heard[self.body] = self._elapsed.total
        for child in [
            child for child, heard in self._heard.items() if self._elapsed.total - heard > SILENCE
        ]:
            self._tree.drop(child)
            del self._heard[child]

    def names(self) -> list[str]:
        """All frames, sorted."""
        return self._tree.names()

    def of(self, frame: str, source: str = "") -> Transform | None:
        """The pose of a frame in `source`, by default the robot's body frame; None if they are not
        connected.
        """
        try:
            return self._tree.lookup(source or self.body, frame.removeprefix("/"))[0]
        except LookupError:
            return None

    def close(self) -> None:
        """Stop listening."""
        for reader in (self._tf, self._static, self._odometry):
            reader.close()
