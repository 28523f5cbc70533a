"""Plots of the page: number fields of topics over time."""

import math
import re
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

from holozen.bus import Bus
from holozen.field_lines import Lines
from holozen.fields import path
from holozen.output import SampleReader
from holozen.transport.samples import RawSubscriber

from . import protocol

WINDOW = 20.0  # s
MAX_FIELDS = 500  # of a message that are offered for plotting
MAX_POINTS = 400  # of a line that are sent; more than a page has pixels for
FIRST = re.compile(
    r"(^|\.)(position|linear|angular|ranges?|velocity|effort|percentage|voltage)(\.|\[|$)"
)
"""The fields that people look at first."""
LAST = re.compile(r"covariance|(^|\.)(header|stamp)(\.|$)")
"""Those that nobody looks at."""


class Chart:
    """One field over the last seconds of `clock` (s)."""

    def __init__(self, bus: Bus, key: str, field: str, clock: Callable[[], float]) -> None:
        self.key, self.field = key, field
        self._name, self._clock = f"{key} {field}", clock
        self._lines = Lines(bus, [(self._name, key, path(field))], SampleReader(), clock)

    def take(self) -> None:
        """Take the messages that have arrived."""
        try:
            self._lines.take()
        except LookupError:
            pass  # the field is in a list, which may have become shorter

    def line(self) -> protocol.Line:
        """The newest points."""
        now, points = self._clock(), self._lines.points[self._name]
        found = [
            (at, value)
            for at, value in list(points)
            if now - WINDOW <= at <= now and math.isfinite(value)
        ]
        found.sort()  # a bag may go back
        return protocol.Line(self.key, self.field, found[:: 1 + len(found) // MAX_POINTS])

    def close(self) -> None:
        """Stop listening."""
        self._lines.close()


class Plots:
    """The plots of one page, over the time (s) of `clock`."""

    def __init__(self, bus: Bus, clock: Callable[[], float]) -> None:
        self._bus, self._clock = bus, clock
        self._charts: dict[tuple[str, str], Chart] = {}
        self._probe: tuple[str, RawSubscriber] | None = (
            None  # of the topic whose fields are to be offered
        )
        self._reader = SampleReader()

    def ask(self, key: str) -> None:
        """Offer the fields of a topic, with its next message."""
        self._end_probe()
        self._probe = key, self._bus.subscribe_raw(key, depth=1)

    def offered(self) -> protocol.FieldsOf | None:
        """The fields that were asked for, once they are known."""
        if self._probe is None or (sample := self._probe[1].try_recv()) is None:
            return None
        key = self._probe[0]
        found = list(islice(fields(self._reader.read(sample, self._bus)), MAX_FIELDS))
        self._end_probe()
        return protocol.FieldsOf(key, sorted(found, key=_rank))

    def switch(self, key: str, field: str, on: bool) -> None:
        """Plot a field, or no longer."""
        if on and (key, field) not in self._charts:
            self._charts[key, field] = Chart(self._bus, key, field, self._clock)
        elif not on and (chart := self._charts.pop((key, field), None)):
            chart.close()

    def take(self) -> None:
        """Take the messages that have arrived."""
        for chart in self._charts.values():
            chart.take()

    def lines(self) -> protocol.Lines | None:
        """All plots; None without any."""
        lines = [chart.line() for chart in self._charts.values()]
        return protocol.Lines(self._clock(), lines) if lines else None

    def close(self) -> None:
        """Stop listening."""
        self._end_probe()
        for chart in self._charts.values():
            chart.close()
        self._charts = {}

    def _end_probe(self) -> None:
        if self._probe:
            self._probe[1].close()
        self._probe = None


def _rank(field: str) -> int:
    """The place of a field among those that are offered."""
    if LAST.search(field):
        return 2
    return 0 if FIRST.search(field) else 1


def fields(value: Any, prefix: str = "") -> Iterator[str]:
    """The paths of the numbers in a message, such as `pose.position.x` and `ranges[0]`."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from fields(inner, f"{prefix}.{name}" if prefix else name)
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from fields(inner, f"{prefix}[{number}]")
    elif isinstance(value, bool | int | float) and prefix:
        yield prefix
