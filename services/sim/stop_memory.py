"""What is remembered of robots that are gone, for the next ones of their names."""

import time
from collections.abc import Collection, Iterable

from holozen.command.stop_files import StopFiles
from holozen.console import report
from holozen.wire import MAX_ENTITIES, release_command

from .commands import Arbiters


class StopMemory:
    """The arbiters of the robots that there are, and of the last ones of their wire names. A
    respawned robot inherits held sources and the software stop; one that was in another sim, the
    stop.

    Attributes:
        files: Where software stops are kept for the next sim; None if they are not.
    """

    def __init__(self) -> None:
        self.files: StopFiles | None = None
        self._last: dict[str, Arbiters] = {}  # by wire name

    def __len__(self) -> int:
        return len(self._last)

    def add(self, wire_name: str, arbiters: Arbiters, living: Collection[Arbiters]) -> None:
        """Let a new robot inherit, and remember it. `living` are the arbiters of all robots that
        there are.
        """
        now = time.monotonic()
        before = self._last.pop(wire_name, None)
        if before:
            arbiters.inherit(before, now)
        self._last[wire_name] = arbiters
        setter = self.files.read(wire_name) if self.files else None
        if setter is not None:
            arbiters.stop(setter, now)
        self.keep(wire_name)
        if arbiters.stopped_by:
            still = f"{wire_name or 'the robot'} is still stopped by {arbiters.stopped_by}"
            report(f"sim: {still}; `{release_command(wire_name)}` lets it drive again")
        if len(self._last) > MAX_ENTITIES:
            self._forget_one(living)

    def _forget_one(self, living: Iterable[Arbiters]) -> None:
        """Forget a robot that is gone; one that is stopped is forgotten last."""
        here = {arbiters.base for arbiters in living}
        gone = [name for name, arbiters in self._last.items() if arbiters.base not in here]
        not_stopped = (wire_name for wire_name in gone if not self.is_stopped(wire_name))
        forgotten = next(not_stopped, gone[0])
        del self._last[forgotten]
        if self.files:
            self.files.forget(forgotten)

    def stop(self, by: str, wire_names: Iterable[str]) -> str:
        """Set the software stop of these robots. Returns why that is not kept for the next sim, or
        "".
        """
        known = [wire_name for wire_name in wire_names if wire_name in self._last]
        for wire_name in known:
            self._last[wire_name].stop(by, time.monotonic())
        return next(filter(None, [self.keep(wire_name) for wire_name in known]), "")

    def is_stopped(self, wire_name: str) -> bool:
        """Whether the software stop of a robot is set."""
        return bool(self._last[wire_name].stopped_by)

    def keep(self, wire_name: str) -> str:
        """Write to its file who stopped a robot. Returns why it is not kept, or ""."""
        setter = self._last[wire_name].stopped_by
        return self.files.write(wire_name, setter) if self.files else ""
