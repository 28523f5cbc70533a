"""The tree of frames over the last seconds: what comes on `tf` goes in, the transform between any two comes out.

Pure: times are arguments, in nanoseconds. Time 0 asks for the newest that all frames on the way have.
"""

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field

from holozen.flags import nearest
from holozen.ros.tf2_math import Rigid, between, unit

KEPT = 10 * 10**9  # ns
BACK = 10**9  # ns behind the newest; so many in a row are no stragglers:
IN_A_ROW = 3  # the clock was set back, as that of a sim that was started again
DEEPEST = 1000  # frames from one to the root


class TransformException(Exception):
    """A transform cannot be given. Its text says why."""


class LookupException(TransformException):
    """There is no such frame, or nothing has come about it yet."""


class ConnectivityException(TransformException):
    """Both frames are there, and nothing connects them."""


class ExtrapolationException(TransformException):
    """The time lies before or after all that came."""


class InvalidArgumentException(TransformException):
    """A frame or a transform that cannot be."""


class TimeoutException(TransformException):
    """It did not come in time."""


@dataclass(slots=True)
class History:
    """What came about one child frame: stamps in order, and parent and transform of each. A static one has one."""

    static: bool = False
    stamps: list[int] = field(default_factory=list)
    values: list[tuple[str, Rigid]] = field(default_factory=list)
    behind: int = 0  # how many in a row came long after newer ones

    def put(self, stamp: int, parent: str, rigid: Rigid, kept: int) -> None:
        """Add a transform; those older than `kept` before the newest are forgotten, and it too if it is as old.

        Where the clock was set back, all that came before is forgotten.
        """
        self.behind = self.behind + 1 if self.stamps and stamp < self.stamps[-1] - BACK else 0
        if self.behind == IN_A_ROW:
            self.stamps, self.values, self.behind = [], [], 0
        at = bisect_left(self.stamps, stamp)
        if at < len(self.stamps) and self.stamps[at] == stamp:
            self.values[at] = parent, rigid
            return
        self.stamps.insert(at, stamp)
        self.values.insert(at, (parent, rigid))
        old = bisect_left(self.stamps, self.stamps[-1] - kept)
        del self.stamps[:old], self.values[:old]

    def parent(self, when: int) -> str:
        """The parent at a time; the nearest that is known."""
        return self.values[max(0, bisect_right(self.stamps, when) - 1) if when else -1][0]

    def at(self, when: int) -> Rigid | None:
        """The transform at a time, between the two around it; None before the first and after the last."""
        if self.static or not when:
            return self.values[-1][1]
        after = bisect_left(self.stamps, when)
        if after < len(self.stamps) and self.stamps[after] == when:
            return self.values[after][1]
        if after in (0, len(self.stamps)):
            return None
        (parent, first), (other, second) = self.values[after - 1], self.values[after]
        if parent != other:
            return first  # it was hung up elsewhere in between
        start, end = self.stamps[after - 1], self.stamps[after]
        return between(first, second, (when - start) / (end - start))


class Frames:
    """Every frame that was named, by its name without a slash before it, which nobody may ask with."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._of: dict[str, History] = {}  # by child
        self._parents: set[str] = set()

    def put(self, parent: str, child: str, stamp: int, rigid: Rigid, static: bool = False) -> None:
        """Add a transform. Raises InvalidArgumentException."""
        parent, child = _name(parent), _name(child)
        if parent == child:
            raise InvalidArgumentException(f"frame {child!r} cannot be its own parent")
        if not all(map(math.isfinite, rigid.translation)):
            raise InvalidArgumentException(f"the translation from {parent!r} to {child!r} is {rigid.translation}")
        try:
            rigid = Rigid(rigid.translation, unit(rigid.rotation))
        except ValueError as error:
            raise InvalidArgumentException(f"from {parent!r} to {child!r} {error}") from None
        history = self._of.get(child)
        if history is None or static or history.static:
            history = self._of[child] = History(static)
        history.put(stamp, parent, rigid, self._kept)
        self._parents.add(parent)

    def clear(self) -> None:
        """Forget all but what is static."""
        self._of = {child: history for child, history in self._of.items() if history.static}
        self._parents = {history.parent(0) for history in self._of.values()}

    def names(self) -> list[str]:
        """All frames, sorted."""
        return sorted({*self._of, *self._parents})

    def histories(self) -> dict[str, History]:
        """What is known about each child frame."""
        return dict(self._of)

    def lookup(self, target: str, source: str, when: int = 0) -> tuple[int, Rigid]:
        """The time, and the transform that takes points of `source` into `target`. Raises TransformException."""
        target, source = self._known(target, "target"), self._known(source, "source")
        up, down = self._ways(target, source, when)
        when = when or self._newest(up + down)
        return when, self._along(up, when, target, source).then(self._along(down, when, target, source).inverse())

    def lookup_fixed(self, target: str, target_time: int, source: str, source_time: int, fixed: str) -> Rigid:
        """As `lookup`, from `source` at its time to `target` at its time, while `fixed` did not move."""
        _, first = self.lookup(fixed, source, source_time)
        _, second = self.lookup(target, fixed, target_time)
        return first.then(second)

    def _known(self, name: str, role: str) -> str:
        if _name(name) != name:
            raise InvalidArgumentException(f"the {role} frame {name!r} begins with a slash; write {_name(name)!r}")
        if name not in self._of and name not in self._parents:
            there = self.names()
            hint = nearest(name, there) or f"; there are {', '.join(there[:20])}" if there else "; no frame is, as yet"
            raise LookupException(f"the {role} frame {name!r} is not there{hint}")
        return name

    def _ways(self, target: str, source: str, when: int) -> tuple[list[str], list[str]]:
        """The frames below the first common one, from `source` up and from `target` up."""
        up, down = self._to_root(source, when), self._to_root(target, when)
        common = next((name for name in up if name in down), None)
        if common is None:
            told = f"frames {target!r} and {source!r} are in two trees, below {down[-1]!r} and {up[-1]!r}"
            raise ConnectivityException(f"{told}; nothing connects these")
        return up[: up.index(common)], down[: down.index(common)]

    def _to_root(self, name: str, when: int) -> list[str]:
        way = [name]
        while (history := self._of.get(way[-1])) is not None:
            way.append(history.parent(when))
            if len(way) > DEEPEST:
                raise LookupException(f"the frames {' > '.join(way[:8])} ... go round in a circle")
        return way

    def _newest(self, way: list[str]) -> int:
        moving = [self._of[name].stamps[-1] for name in way if not self._of[name].static]
        return min(moving, default=0)

    def _along(self, way: list[str], when: int, target: str, source: str) -> Rigid:
        """From the first frame of the way into the parent of its last."""
        total = Rigid()
        for name in way:
            history = self._of[name]
            step = history.at(when)
            if step is None:
                raise ExtrapolationException(_outside(history, name, when, target, source))
            total = total.then(step)
        return total


def _outside(history: History, name: str, when: int, target: str, source: str) -> str:
    first, last = history.stamps[0], history.stamps[-1]
    side, far = ("newer", when - last) if when > last else ("older", first - when)
    told = f"from {source!r} to {target!r} at {seconds(when)} s: that is {seconds(far)} s {side} than what is known"
    return f"{told} of {name!r} (from {seconds(first)} to {seconds(last)} s); Time() asks for the newest"


def seconds(nanoseconds: int) -> str:
    """Nanoseconds as seconds, with three digits."""
    return f"{nanoseconds / 1e9:.3f}"


def _name(name: object) -> str:
    if not isinstance(name, str) or not name.strip("/"):
        raise InvalidArgumentException(f"{name!r} is no frame; a frame is a text such as 'odom'")
    return name.lstrip("/")
