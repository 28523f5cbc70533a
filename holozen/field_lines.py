"""Fields of live messages as lines: the points of each, as they arrive."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from holozen.bus import Bus
from holozen.fields import pick
from holozen.output import SampleReader
from holozen.transport.samples import RawSubscriber

Field = tuple[str, str, tuple[str | int, ...]]
"""A field: as written on the command line, its key, and its path in the messages."""

MAX_POINTS = 5000  # of a line


class Lines:
    """The points of each field, as they arrive: the time by `clock`, and the value."""

    def __init__(
        self,
        bus: Bus,
        fields: list[Field],
        reader: SampleReader,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.points: dict[str, deque[tuple[float, float]]] = {
            name: deque(maxlen=MAX_POINTS) for name, _, _ in fields
        }
        self.bad = 0  # messages that could not be decoded
        self._fields, self._bus, self._reader, self._clock = fields, bus, reader, clock
        self._subscribers: dict[str, RawSubscriber] = {}
        for key in dict.fromkeys(key for _, key, _ in fields):
            self._subscribers[key] = bus.subscribe_raw(key)
            self._subscribers[key].ends.append(bus.announce("sub", "any/msg/Any", key))

    def take(self) -> list[dict[str, float]]:
        """Take in the messages that wait, and return their rows. Raises LookupError for a missing
        field.
        """
        rows = []
        for key, subscriber in self._subscribers.items():
            while (sample := subscriber.try_recv()) is not None:
                value = self._reader.read(sample, self._bus)
                if isinstance(value, dict | list):
                    rows.append(self._add(key, value))
                else:
                    self.bad += 1
        return rows

    def _add(self, key: str, value: Any) -> dict[str, float]:
        row = {}
        for name, its, place in self._fields:
            if its == key:
                try:
                    row[name] = _number(pick(value, place))
                except LookupError as error:
                    raise LookupError(f"{name}: {error.args[0]}") from None
                self.points[name].append((self._clock(), row[name]))
        return row

    def close(self) -> None:
        """Stop listening."""
        for subscriber in self._subscribers.values():
            subscriber.close()


def _number(value: Any) -> float:
    if isinstance(value, bool | int | float):
        return float(value)
    inside = f"; it has {', '.join(map(str, value))}" if isinstance(value, dict) else ""
    raise LookupError(f"it is not a number{inside}")
