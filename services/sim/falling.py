"""Reports what falls for long: the world has no ground below it."""

import time

from holozen.console import report

from .entities import Entities

LONG = 5.0  # s of a fall that is reported
LOOK = 0.5  # s between two looks


class Falling:
    """Looks for what falls, and reports each once."""

    def __init__(self, entities: Entities, gravity: float) -> None:
        """`gravity` is the upward acceleration, in m/s^2."""
        self._entities, self._fast = entities, gravity * LONG
        self._looked_at = 0.0
        self._reported = set[int]()

    def look(self) -> bool:
        """Report what falls now as fast as after LONG seconds. Returns that it answered no
        request.
        """
        if self._fast >= 0 or time.monotonic() - self._looked_at < LOOK:
            return False
        self._looked_at = time.monotonic()
        for entity in self._entities:
            if entity.model.static or entity.number in self._reported:
                continue
            if entity.body.twist()[0][2] < self._fast:
                self._reported.add(entity.number)
                height = entity.body.pose()[0][2]
                report(
                    f"sim: warning: {entity.name} has been falling for {LONG:g} s and is at z "
                    f"{height:.0f}: there is no"
                    " ground below it; a world has one with "
                    "<include><uri>model://ground_plane</uri></include>"
                )
        return False
