"""BufferCore: the tree of frames over the last seconds, and the transform between any two of them.

Pure: times are arguments, in nanoseconds. Time 0 asks for the newest that all frames on the path
    have.
"""

import math
from bisect import bisect_left, bisect_right

from msgspec import Struct

from holozen.rotation import Transform, normalize
from holozen.suggest import suggest

CACHE_TIME = 10 * 10**9  # ns
# ns before the newest stamp; that many stamps in a row this old are no stragglers:
RESET_AGE = 10**9
RESET_COUNT = 3  # the clock was set back, as by a restarted sim
DEEPEST = 1000  # frames from one to the root


class TransformException(Exception):
    """A transform is not available. The message gives the reason."""


class LookupException(TransformException):
    """The frame does not exist, or nothing about it has arrived yet."""


class ConnectivityException(TransformException):
    """Both frames exist, and nothing connects them."""


class ExtrapolationException(TransformException):
    """The time is before or after everything that arrived."""


class InvalidArgumentException(TransformException):
    """An invalid frame or transform."""


class TimeoutException(TransformException):
    """It did not arrive in time."""


class History(Struct):
    """The transforms of one child frame: stamps in order, each with parent and transform. A static
    frame has one.
    """

    static: bool = False
    stamps: list[int] = []
    values: list[tuple[str, Transform]] = []
    stragglers: int = 0  # how many in a row arrived long after newer ones

    def put(self, stamp: int, parent: str, transform: Transform, cache_time: int) -> None:
        """Add a transform, and forget those older than `cache_time` before the newest, this one
        too.

        If the clock was set back, everything from before is forgotten.
        """
        self.stragglers = (
            self.stragglers + 1 if self.stamps and stamp < self.stamps[-1] - RESET_AGE else 0
        )
        if self.stragglers == RESET_COUNT:
            self.stamps, self.values, self.stragglers = [], [], 0
        at = bisect_left(self.stamps, stamp)
        if at < len(self.stamps) and self.stamps[at] == stamp:
            self.values[at] = parent, transform
            return
        self.stamps.insert(at, stamp)
        self.values.insert(at, (parent, transform))
        old = bisect_left(self.stamps, self.stamps[-1] - cache_time)
        del self.stamps[:old], self.values[:old]

    def parent(self, when: int) -> str:
        """The parent at a time, or at the nearest known time."""
        return self.values[max(0, bisect_right(self.stamps, when) - 1) if when else -1][0]

    def at(self, when: int) -> Transform | None:
        """The transform at a time, interpolated; None before the first and after the last."""
        if self.static or not when:
            return self.values[-1][1]
        after = bisect_left(self.stamps, when)
        if after < len(self.stamps) and self.stamps[after] == when:
            return self.values[after][1]
        if after in (0, len(self.stamps)):
            return None
        (parent, first), (other, second) = self.values[after - 1], self.values[after]
        if parent != other:
            return first  # the frame got another parent in between
        start, end = self.stamps[after - 1], self.stamps[after]
        return first.interpolate(second, (when - start) / (end - start))


class BufferCore:
    """All frames, by name. A leading slash is removed from names that arrive, and not allowed in
    lookups.
    """

    def __init__(self, cache_time: int = CACHE_TIME) -> None:
        self._cache_time = cache_time
        self._histories: dict[str, History] = {}  # by child frame
        self._parents: set[str] = set()

    def put(
        self, parent: str, child: str, stamp: int, transform: Transform, static: bool = False
    ) -> None:
        """Add a transform. Raises InvalidArgumentException."""
        parent, child = _frame_name(parent), _frame_name(child)
        if parent == child:
            raise InvalidArgumentException(f"frame {child!r} cannot be its own parent")
        if not all(map(math.isfinite, transform.translation)):
            raise InvalidArgumentException(
                f"the translation from {parent!r} to {child!r} is {transform.translation}"
            )
        try:
            transform = Transform(transform.translation, normalize(transform.rotation))
        except ValueError as error:
            raise InvalidArgumentException(f"from {parent!r} to {child!r}: {error}") from None
        history = self._histories.get(child)
        if history is None or static or history.static:
            history = self._histories[child] = History(static)
        history.put(stamp, parent, transform, self._cache_time)
        self._parents.add(parent)

    def clear(self) -> None:
        """Forget everything but static transforms."""
        self._histories = {
            child: history for child, history in self._histories.items() if history.static
        }
        self._parents = {history.parent(0) for history in self._histories.values()}

    def names(self) -> list[str]:
        """All frames, sorted."""
        return sorted({*self._histories, *self._parents})

    def histories(self) -> dict[str, History]:
        """The history of each child frame."""
        return dict(self._histories)

    def lookup(self, target: str, source: str, when: int = 0) -> tuple[int, Transform]:
        """The time, and the transform that takes points of `source` into `target`. Raises
        TransformException.
        """
        target, source = self._known(target, "target"), self._known(source, "source")
        from_source, from_target = self._paths(target, source, when)
        when = when or self._newest(from_source + from_target)
        up = self._along(from_source, when, target, source)
        return when, self._along(from_target, when, target, source).inverse() @ up

    def lookup_full(
        self, target: str, target_time: int, source: str, source_time: int, fixed: str
    ) -> Transform:
        """As `lookup`, from `source` at its time to `target` at its time, assuming that `fixed` did
        not move.
        """
        _, first = self.lookup(fixed, source, source_time)
        _, second = self.lookup(target, fixed, target_time)
        return second @ first

    def _known(self, name: str, role: str) -> str:
        if (bare := _frame_name(name)) != name:
            raise InvalidArgumentException(
                f"the {role} frame {name!r} starts with a slash; write {bare!r}"
            )
        if name not in self._histories and name not in self._parents:
            frames = self.names()
            hint = (
                suggest(name, frames) or f"; frames: {', '.join(frames[:20])}"
                if frames
                else "; no frames so far"
            )
            raise LookupException(f"the {role} frame {name!r} does not exist{hint}")
        return name

    def _paths(self, target: str, source: str, when: int) -> tuple[list[str], list[str]]:
        """The frames from `source`, and from `target`, up to their first common one, which is left
        out.
        """
        from_source, from_target = self._to_root(source, when), self._to_root(target, when)
        common = next((name for name in from_source if name in from_target), None)
        if common is None:
            roots = f"with the roots {from_target[-1]!r} and {from_source[-1]!r}"
            raise ConnectivityException(
                f"frames {target!r} and {source!r} are in two unconnected trees, {roots}"
            )
        return from_source[: from_source.index(common)], from_target[: from_target.index(common)]

    def _to_root(self, name: str, when: int) -> list[str]:
        path = [name]
        while (history := self._histories.get(path[-1])) is not None:
            path.append(history.parent(when))
            if len(path) > DEEPEST:
                raise LookupException(f"the frames {' > '.join(path[:8])} ... form a loop")
        return path

    def _newest(self, path: list[str]) -> int:
        moving = [
            self._histories[name].stamps[-1] for name in path if not self._histories[name].static
        ]
        return min(moving, default=0)

    def _along(self, path: list[str], when: int, target: str, source: str) -> Transform:
        """From the first frame of a path into the parent of its last."""
        total = Transform()
        for name in path:
            history = self._histories[name]
            step = history.at(when)
            if step is None:
                raise ExtrapolationException(_out_of_range(history, name, when, target, source))
            total = step @ total
        return total


def _out_of_range(history: History, name: str, when: int, target: str, source: str) -> str:
    first, last = history.stamps[0], history.stamps[-1]
    side, far = ("after", when - last) if when > last else ("before", first - when)
    text = (
        f"from {source!r} to {target!r} at {seconds(when)} s: that is {seconds(far)} s {side} "
        "the transforms"
    )
    return (
        f"{text} of {name!r} (from {seconds(first)} to {seconds(last)} s); Time() asks for the "
        "newest"
    )


def seconds(nanoseconds: int) -> str:
    """Nanoseconds as seconds, with three digits."""
    return f"{nanoseconds / 1e9:.3f}"


def _frame_name(name: object) -> str:
    if not isinstance(name, str) or not name.strip("/"):
        raise InvalidArgumentException(f"{name!r} is not a frame; a frame is a str such as 'odom'")
    return name.lstrip("/")
