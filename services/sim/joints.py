"""The motors of a robot's joints."""

import math

from .jointed import JointedBody
from .motion import JointMotion


class Motors:
    """The motors of some joints of a body, in N m or N at most `effort` each. What is not commanded holds still, once
    it was; `together`, all of them hold still while one is commanded: the wheels of one base.
    """

    def __init__(
        self, body: JointedBody, names: frozenset[str], effort: float = math.inf, together: bool = False
    ) -> None:
        self._body, self.names, self._effort, self._together = body, names, effort, together
        self._held: frozenset[str] = frozenset()
        self._last: JointMotion | None = None

    def do(self, motion: JointMotion | None) -> None:
        """The motion of the next step; None: hold still what was moved before."""
        told = frozenset(name for name, _ in motion.values) if motion else frozenset[str]()
        if motion and motion != self._last:
            for name in told:
                self._body.release(name)
        self._last = motion
        self._held |= self.names if motion and self._together else told
        for name in self._held - told:
            self._body.turn(name, 0.0, self._effort)
        if motion:
            self._move(motion)

    def forget(self) -> None:
        """Another one moves them from now on."""
        self._held, self._last = frozenset(), None

    def _move(self, motion: JointMotion) -> None:
        for name, value in motion.values:
            if motion.kind == "position":
                self._body.go(name, value)
            elif motion.kind == "velocity":
                self._body.turn(name, value, self._effort)
            else:
                self._body.push(name, value, self._effort)
