"""tf2_ros.Buffer: the newest transforms, and those of the last seconds."""

import threading
import time as clock
from collections.abc import Callable
from typing import Any

from holozen.ros import context as contexts
from holozen.ros import generated
from holozen.ros.missing import Told
from holozen.ros.task import Future
from holozen.ros.tf2_frames import KEPT, Frames, InvalidArgumentException, TransformException, seconds
from holozen.ros.tf2_math import Rigid
from holozen.ros.time import Duration, Time

LOOK = 0.1  # s between two looks whether a signal has ended rclpy

Do = Callable[[Any, Any], Any]

_by_type: dict[type, Do] = {}


class TypeException(TransformException):
    """A message of this type cannot be transformed."""


class TransformRegistration:
    """Says how messages of a type are transformed: `add(PoseStamped, do_transform)`."""

    def add(self, type_: type, callback: Do) -> None:
        """`callback(message, transform)` gives the message in the transform's frame."""
        _by_type[type_] = callback

    def get(self, type_: type) -> Do:
        """What was added for a type. Raises TypeException."""
        if type_ not in _by_type:
            import holozen.ros.tf2_geometry_msgs  # noqa: F401  it adds the usual ones
        if type_ not in _by_type:
            known = ", ".join(sorted(each.__name__ for each in _by_type))
            raise TypeException(f"no way to transform {type_.__name__}; there is one for {known}")
        return _by_type[type_]


class Buffer(Told):
    """Transforms by their frames, for `cache_time` (10 s). Any thread may ask, and put.

    A lookup with a timeout waits for what comes meanwhile, on this machine's clock: in a callback that nobody else
    spins, nothing does.
    """

    def __init__(self, cache_time: Duration | None = None, node: Any = None) -> None:
        self._frames = Frames(cache_time.nanoseconds if cache_time else KEPT)
        self._changed = threading.Condition()
        self._waiting: list[tuple[Callable[[], Any], Future]] = []
        self.node = node

    def set_transform(self, transform: Any, authority: str) -> None:
        """Put a TransformStamped. Raises InvalidArgumentException."""
        self._put(transform, static=False)

    def set_transform_static(self, transform: Any, authority: str) -> None:
        """Put one that holds at all times. Raises InvalidArgumentException."""
        self._put(transform, static=True)

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = None) -> Any:
        """The TransformStamped that takes points of `source_frame` into `target_frame`.

        `Time()` asks for the newest. Raises LookupException, ConnectivityException or ExtrapolationException, after
        `timeout` (a Duration) if one is given; ExternalShutdownException where a signal has ended rclpy.
        """
        when = nanoseconds(time)
        stamp, rigid = self._within(timeout, lambda: self._frames.lookup(target_frame, source_frame, when))
        return _message(target_frame, source_frame, stamp, rigid)

    def lookup_transform_full(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str,
        timeout: Any = None,
    ) -> Any:  # fmt: skip
        """As lookup_transform, from a frame at one time to one at another, while `fixed_frame` did not move."""
        to, since = nanoseconds(target_time), nanoseconds(source_time)
        look = lambda: self._frames.lookup_fixed(target_frame, to, source_frame, since, fixed_frame)  # noqa: E731
        return _message(target_frame, source_frame, to, self._within(timeout, look))

    def can_transform(
        self, target_frame: str, source_frame: str, time: Any, timeout: Any = None, return_debug_tuple: bool = False
    ) -> Any:
        """Whether lookup_transform would give one; with `return_debug_tuple`, and why not."""
        try:
            self.lookup_transform(target_frame, source_frame, time, timeout)
        except TransformException as error:
            return (False, str(error)) if return_debug_tuple else False
        return (True, "") if return_debug_tuple else True

    def can_transform_full(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str,
        timeout: Any = None, return_debug_tuple: bool = False,
    ) -> Any:  # fmt: skip
        """Whether lookup_transform_full would give one; with `return_debug_tuple`, and why not."""
        try:
            self.lookup_transform_full(target_frame, target_time, source_frame, source_time, fixed_frame, timeout)
        except TransformException as error:
            return (False, str(error)) if return_debug_tuple else False
        return (True, "") if return_debug_tuple else True

    def transform(self, object_stamped: Any, target_frame: str, timeout: Any = None, new_type: Any = None) -> Any:
        """A stamped point, vector or pose in another frame. Raises as lookup_transform, and TypeException."""
        do = TransformRegistration().get(type(object_stamped))
        if new_type not in (None, type(object_stamped)):
            raise TypeException(f"{type(object_stamped).__name__} cannot be turned into {new_type.__name__}")
        header = object_stamped.header
        return do(object_stamped, self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout))

    def wait_for_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Future:
        """A Future that is done, with True, once lookup_transform would give one."""
        return self._later(lambda: bool(self._frames.lookup(target_frame, source_frame, nanoseconds(time))))

    def lookup_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Future:
        """A Future of what lookup_transform will give."""
        return self._later(lambda: self.lookup_transform(target_frame, source_frame, time))

    def clear(self) -> None:
        """Forget all but what is static."""
        with self._changed:
            self._frames.clear()

    def all_frames_as_string(self) -> str:
        """Every frame and its parent, a line each."""
        with self._changed:
            found = self._frames.histories()
        return "".join(f"Frame {child} exists with parent {each.parent(0)}.\n" for child, each in sorted(found.items()))

    def all_frames_as_yaml(self) -> str:
        """Every frame with its parent, and from when to when it is known, in seconds."""
        with self._changed:
            found = self._frames.histories()
        lines = []
        for child, each in sorted(found.items()):
            lines += [f"{child}:", f"  parent: '{each.parent(0)}'"]
            times = (("most_recent_transform", each.stamps[-1]), ("oldest_transform", each.stamps[0]))
            lines += [f"  {name}: {seconds(stamp)}" for name, stamp in times]
        return "\n".join(lines) + "\n"

    def _put(self, transform: Any, static: bool) -> None:
        t, q = transform.transform.translation, transform.transform.rotation
        rigid, header = Rigid((t.x, t.y, t.z), (q.x, q.y, q.z, q.w)), transform.header
        with self._changed:
            self._frames.put(header.frame_id, transform.child_frame_id, nanoseconds(header.stamp), rigid, static)
            self._changed.notify_all()
            waiting, self._waiting = self._waiting, []
        for look, future in waiting:  # outside the lock: what is called when it is done may ask again
            self._try(look, future)

    def _within(self, timeout: Any, look: Callable[[], Any]) -> Any:
        deadline = clock.monotonic() + (nanoseconds(timeout) / 1e9 if timeout is not None else 0.0)
        with self._changed:
            while True:
                try:
                    return look()
                except InvalidArgumentException:
                    raise  # it will be wrong for ever
                except TransformException:
                    left = deadline - clock.monotonic()
                    if left <= 0.0:
                        raise
                    contexts.get_default_context().check_running("wait for a transform")
                    self._changed.wait(min(left, LOOK))

    def _later(self, look: Callable[[], Any]) -> Future:
        future = Future()
        self._try(look, future)
        return future

    def _try(self, look: Callable[[], Any], future: Future) -> None:
        if future.cancelled():
            return
        with self._changed:
            try:
                found = look()
            except TransformException:
                self._waiting.append((look, future))
                return
        future.set_result(found)


def nanoseconds(time: Any) -> int:
    """Nanoseconds of an rclpy Time or Duration, or of their messages. Raises TypeError."""
    if hasattr(time, "nanoseconds"):
        return int(time.nanoseconds)
    if hasattr(time, "sec") and hasattr(time, "nanosec"):
        return int(time.sec) * 10**9 + int(time.nanosec)
    raise TypeError(f"{time!r} is no time; give rclpy.time.Time(), or a Duration(seconds=...) as timeout")


def _message(target: str, source: str, stamp: int, rigid: Rigid) -> Any:
    message: Any = generated.find("geometry_msgs/msg/TransformStamped")()
    message.header.stamp = Time(nanoseconds=stamp).to_msg()
    message.header.frame_id, message.child_frame_id = target, source
    t, q = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = rigid.translation
    q.x, q.y, q.z, q.w = rigid.rotation
    return message
