"""Buffer: the transforms of the last seconds, and lookups that wait for one."""

import threading
import time as clock
from collections.abc import Callable
from functools import partial
from typing import Any

from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.generated import find
from holozen.ros.rclpy.context import get_default_context
from holozen.ros.rclpy.task import Future
from holozen.ros.rclpy.time import Duration, Time
from holozen.ros.tf2_geometry_msgs import (
    do_transform_point,
    do_transform_pose_stamped,
    do_transform_pose_with_covariance_stamped,
    do_transform_vector3,
)
from holozen.ros.tf2_ros.buffer_core import (
    CACHE_TIME,
    BufferCore,
    InvalidArgumentException,
    TransformException,
    seconds,
)
from holozen.rotation import Transform

POLL = 0.1  # s between two checks whether a signal has shut down rclpy

DoTransform = Callable[[Any, Any], Any]

_by_type: dict[type, DoTransform] = {}
_USUAL: dict[str, DoTransform] = {
    "geometry_msgs/msg/PointStamped": do_transform_point,
    "geometry_msgs/msg/Vector3Stamped": do_transform_vector3,
    "geometry_msgs/msg/PoseStamped": do_transform_pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": do_transform_pose_with_covariance_stamped,
}


class TypeException(TransformException):
    """A message of this type cannot be transformed."""


class TransformRegistration:
    """The functions that transform messages, by type: `add(PoseStamped,
    do_transform_pose_stamped)`.
    """

    def add(self, type_: type, callback: DoTransform) -> None:
        """`callback(message, transform)` gives the message in the transform's frame."""
        _by_type[type_] = callback

    def get(self, type_: type) -> DoTransform:
        """The function for a type. Raises TypeException."""
        found = _by_type.get(type_) or _USUAL.get(getattr(type_, "ROS", ""))
        if found is None:
            known = sorted(
                {
                    *(each.__name__ for each in _by_type),
                    *(name.rpartition("/")[2] for name in _USUAL),
                }
            )
            raise TypeException(f"{type_.__name__} cannot be transformed; {', '.join(known)} can")
        return found


class Buffer(HelpfulAttributes):
    """The transforms of the last `cache_time` (10 s). Safe to use from any thread.

    A lookup with a timeout waits on this machine's clock. In a callback nothing arrives while it
    waits, unless another thread spins.
    """

    def __init__(self, cache_time: Duration | None = None, node: Any = None) -> None:
        self._core = BufferCore(cache_time.nanoseconds if cache_time else CACHE_TIME)
        self._lock = threading.RLock()  # see holozen.ros.rclpy.waitable
        self._changed = threading.Condition(self._lock)
        self._waiting: list[tuple[Callable[[], Any], Future]] = []
        self.node = node

    def set_transform(self, transform: Any, authority: str) -> None:
        """Add a TransformStamped. Raises InvalidArgumentException."""
        self._put(transform, static=False)

    def set_transform_static(self, transform: Any, authority: str) -> None:
        """Add one that is valid at all times. Raises InvalidArgumentException."""
        self._put(transform, static=True)

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: Any, timeout: Any = None
    ) -> Any:
        """The TransformStamped that takes points of `source_frame` into `target_frame`.

        `Time()` asks for the newest. Raises LookupException, ConnectivityException or
        ExtrapolationException, after `timeout` (a Duration) if one is given;
        ExternalShutdownException if a signal has shut down rclpy.
        """
        when = nanoseconds(time)
        stamp, found = self._within(
            timeout, lambda: self._core.lookup(target_frame, source_frame, when)
        )
        return message_of(target_frame, source_frame, stamp, found)

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = None,
    ) -> Any:
        """As lookup_transform, between two frames at two times, assuming that `fixed_frame` did not
        move.
        """
        to, since = nanoseconds(target_time), nanoseconds(source_time)
        look = lambda: self._core.lookup_full(target_frame, to, source_frame, since, fixed_frame)  # noqa: E731
        return message_of(target_frame, source_frame, to, self._within(timeout, look))

    def can_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any = None,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Whether lookup_transform would succeed; with `return_debug_tuple` also why not."""
        look = partial(self.lookup_transform, target_frame, source_frame, time, timeout)
        return _succeeds(look, return_debug_tuple)

    def can_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = None,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Whether lookup_transform_full would succeed; with `return_debug_tuple` also why not."""
        words = (target_frame, target_time, source_frame, source_time, fixed_frame, timeout)
        return _succeeds(partial(self.lookup_transform_full, *words), return_debug_tuple)

    def transform(
        self, object_stamped: Any, target_frame: str, timeout: Any = None, new_type: Any = None
    ) -> Any:
        """A stamped point, vector or pose in another frame. Raises as lookup_transform, and
        TypeException.
        """
        do = TransformRegistration().get(type(object_stamped))
        if new_type not in (None, type(object_stamped)):
            raise TypeException(
                f"{type(object_stamped).__name__} cannot be converted to {new_type.__name__}"
            )
        header = object_stamped.header
        return do(
            object_stamped,
            self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout),
        )

    def wait_for_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Future:
        """A Future that becomes True once lookup_transform would succeed."""
        return self._later(
            lambda: bool(self._core.lookup(target_frame, source_frame, nanoseconds(time)))
        )

    def lookup_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Future:
        """A Future of the result of lookup_transform, once it succeeds."""
        return self._later(lambda: self.lookup_transform(target_frame, source_frame, time))

    def clear(self) -> None:
        """Forget everything but static transforms."""
        with self._lock:
            self._core.clear()

    def all_frames_as_string(self) -> str:
        """Every frame and its parent, one line each."""
        with self._lock:
            found = self._core.histories()
        return "".join(
            f"Frame {child} exists with parent {each.parent(0)}.\n"
            for child, each in sorted(found.items())
        )

    def all_frames_as_yaml(self) -> str:
        """Every frame with its parent, and the times of its first and last transform in seconds."""
        with self._lock:
            found = self._core.histories()
        lines = []
        for child, each in sorted(found.items()):
            lines += [f"{child}:", f"  parent: '{each.parent(0)}'"]
            times = (
                ("most_recent_transform", each.stamps[-1]),
                ("oldest_transform", each.stamps[0]),
            )
            lines += [f"  {name}: {seconds(stamp)}" for name, stamp in times]
        return "\n".join(lines) + "\n"

    def _put(self, transform: Any, static: bool) -> None:
        rigid = Transform.of(transform.transform.translation, transform.transform.rotation)
        header = transform.header
        with self._lock:
            self._core.put(
                header.frame_id, transform.child_frame_id, nanoseconds(header.stamp), rigid, static
            )
            self._changed.notify_all()
            waiting, self._waiting = self._waiting, []
        for look, future in waiting:  # outside the lock: a done callback may look up again
            self._try(look, future)

    def _within(self, timeout: Any, look: Callable[[], Any]) -> Any:
        deadline = clock.monotonic() + (nanoseconds(timeout) / 1e9 if timeout is not None else 0.0)
        with self._lock:
            while True:
                try:
                    return look()
                except InvalidArgumentException:
                    raise  # waiting does not help
                except TransformException:
                    left = deadline - clock.monotonic()
                    if left <= 0.0:
                        raise
                    get_default_context().check_running("wait for a transform")
                    self._changed.wait(min(left, POLL))

    def _later(self, look: Callable[[], Any]) -> Future:
        future = Future()
        self._try(look, future)
        return future

    def _try(self, look: Callable[[], Any], future: Future) -> None:
        if future.cancelled():
            return
        with self._lock:
            try:
                found = look()
            except InvalidArgumentException as error:  # waiting does not help
                future.set_exception(error)
                return
            except TransformException:
                self._waiting.append((look, future))
                return
        future.set_result(found)


def _succeeds(look: Callable[[], object], with_reason: bool) -> Any:
    try:
        look()
    except TransformException as error:
        return (False, str(error)) if with_reason else False
    return (True, "") if with_reason else True


def nanoseconds(time: Any) -> int:
    """Nanoseconds of an rclpy Time or Duration, or of their messages. Raises TypeError."""
    if hasattr(time, "nanoseconds"):
        return int(time.nanoseconds)
    if hasattr(time, "sec") and hasattr(time, "nanosec"):
        return int(time.sec) * 10**9 + int(time.nanosec)
    raise TypeError(
        f"{time!r} is not a time; use rclpy.time.Time(), or a Duration(seconds=...) as timeout"
    )


def message_of(target: str, source: str, stamp: int, transform: Transform) -> Any:
    """The TransformStamped from `source` to `target` at `stamp` (ns)."""
    message: Any = find("geometry_msgs/msg/TransformStamped")()
    message.header.stamp = Time(nanoseconds=stamp).to_msg()
    message.header.frame_id, message.child_frame_id = target, source
    t, q = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = transform.translation
    q.x, q.y, q.z, q.w = transform.rotation
    return message
