"""Plots in the page: number fields of topics over time."""

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import numpy as np
import viser

from holozen.bus import Bus
from holozen.cli.fields import path
from holozen.cli.output import Reader
from holozen.cli.plot import Lines
from holozen.transport.samples import RawSubscriber

from .displays import Place
from .scene import Scene

NONE = "(none)"
WINDOW = 20.0  # s
DRAW_EVERY = 4  # frames of the page
MAX_FIELDS = 500  # of a message that are offered for plotting
HEIGHT = 140  # CSS pixels
PADDING = (10, 10, 0, 0)  # CSS pixels at the top, right, bottom and left, for half of an axis' number
BLUE = "#1f5fd0"


class Chart:
    """One field over the last seconds of `clock` (s)."""

    def __init__(self, client: viser.ClientHandle, bus: Bus, key: str, field: str, clock: Callable[[], float]) -> None:
        self.name = f"{key} {field}"
        self._client, self._clock = client, clock
        self._lines = Lines(bus, [(self.name, key, path(field))], Reader(), clock)
        self._folder = client.gui.add_folder(self.name)
        with self._folder:
            self.remove = client.gui.add_button("Remove")
        self._plot: viser.GuiUplotHandle | None = None

    def take(self) -> None:
        """Take the messages that have arrived."""
        try:
            self._lines.take()
        except LookupError:
            pass  # the field is in a list, which may have become shorter

    def draw(self) -> None:
        """Show the newest points."""
        now, points = self._clock(), self._lines.points[self.name]
        found = [(at, value) for at, value in list(points) if now - WINDOW <= at <= now and math.isfinite(value)]
        if len(found) < 2:
            return
        data = tuple(np.array(column, float) for column in zip(*sorted(found), strict=True))  # a bag may go back
        if self._plot:
            self._plot.data = data
            return
        with self._folder:
            series = (viser.uplot.Series(label="s"), viser.uplot.Series(label=self.name, stroke=BLUE, width=2))
            scales = {"x": viser.uplot.Scale(time=False)}
            self._plot = self._client.gui.add_uplot(
                data, series, scales=scales, padding=PADDING, height=HEIGHT, order=0
            )

    def close(self) -> None:
        """Remove it from the page."""
        self._lines.close()
        self._folder.remove()


class Plots:
    """The plots of one page, drawn over the time (s) of `clock`."""

    def __init__(
        self, client: viser.ClientHandle, place: Place, bus: Bus, scene: Scene, clock: Callable[[], float]
    ) -> None:
        self._client, self._place, self._bus, self._scene, self._clock = client, place, bus, scene, clock
        self._charts: list[Chart] = []
        self._probe: RawSubscriber | None = None  # of the topic whose fields are to be offered
        self._reader = Reader()
        self._updates = 0
        with place:
            self._topic = client.gui.add_dropdown("Topic", (NONE,))
            self._field = client.gui.add_dropdown("Field", (NONE,))
            self._add = client.gui.add_button("Plot it")
            self._pause = client.gui.add_checkbox("Pause plots", False)
        self._topic.on_update(self._choose)
        self._add.on_click(self._plot)

    def update(self) -> None:
        """Offer the present topics, and draw the plots."""
        topics = (NONE, *self._scene.topics)
        if topics != self._topic.options:
            chosen = self._topic.value
            self._topic.options = topics
            self._topic.value = chosen if chosen in topics else NONE  # type: ignore[misc]
        if self._probe and (sample := self._probe.try_recv()):
            found = list(islice(fields(self._reader.read(sample, self._bus)), MAX_FIELDS))
            self._field.options = tuple(found) or (NONE,)
            self._end_probe()
        self._updates += 1
        for chart in self._charts:
            chart.take()
            if self._updates % DRAW_EVERY == 0 and not self._pause.value:
                chart.draw()

    def close(self) -> None:
        """Stop listening."""
        self._end_probe()
        for chart in self._charts:
            chart.close()
        self._charts = []

    async def _choose(self, _event: Any) -> None:
        self._end_probe()
        if self._topic.value != NONE:
            self._field.options = (NONE,)
            self._probe = self._bus.subscribe_raw(self._topic.value, depth=1)

    async def _plot(self, _event: Any) -> None:
        key, field = self._topic.value, self._field.value
        if NONE in (key, field) or any(chart.name == f"{key} {field}" for chart in self._charts):
            return
        with self._place:
            chart = Chart(self._client, self._bus, key, field, self._clock)
        self._charts.append(chart)

        async def remove(_event: Any) -> None:
            self._charts.remove(chart)
            chart.close()

        chart.remove.on_click(remove)

    def _end_probe(self) -> None:
        if self._probe:
            self._probe.close()
        self._probe = None


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
