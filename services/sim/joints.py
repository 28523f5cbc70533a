"""The motors of a robot's joints."""

from .jointed import JointedBody
from .motion import JointMotion


class Motors:
    """The motors of some joints of a body. What is not commanded holds still, once it was."""

    def __init__(self, body: JointedBody, names: frozenset[str]) -> None:
        self._body, self.names = body, names
        self._held: set[str] = set()
        self._last: JointMotion | None = None

    def do(self, motion: JointMotion | None) -> None:
        """The motion of the next step; None: hold still what was moved before."""
        if motion != self._last:
            told = {name for name, _ in motion.values} if motion else set()
            for name in self._held - told:
                self._body.turn(name, 0.0)
            for name in told:
                self._body.release(name)
            self._held |= told
            self._last = motion
        if motion:
            self._move(motion)

    def _move(self, motion: JointMotion) -> None:
        for name, value in motion.values:
            if motion.kind == "position":
                self._body.go(name, value)
            elif motion.kind == "velocity":
                self._body.turn(name, value)
            else:
                self._body.push(name, value)
