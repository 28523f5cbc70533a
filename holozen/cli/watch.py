"""What `topic hz`, `bw` and `delay` share: listen to keys, and print a report of each once a second."""

import json
import threading
import time
from collections import deque

from holozen.cli.near import meant
from holozen.cli.noun import open_bus
from holozen.cli.spread import lost
from holozen.errors import BusError
from holozen.flags import count, key, number
from holozen.process import stop_event
from holozen.tell import printable, say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable
    from typing import Any

    from holozen.bus import Bus
    from holozen.tap import Sample, Tap

    Report = dict[str, Any]
    Measure = Callable[[Sample, float], float | None]

EVERY = 1.0  # s between two reports


class Window:
    """The last samples of one key: when they came (s, monotonic), a measured value each, and their numbers."""

    def __init__(self, size: int) -> None:
        self.times: deque[float] = deque(maxlen=size)
        self.values: deque[float] = deque(maxlen=size)
        self._numbers: deque[tuple[str, int]] = deque(maxlen=size)
        self.fresh = False  # whether any came since the last report

    def add(self, sample: "Sample", now: float, value: float) -> None:
        """A sample came."""
        if found := sample.number:
            self._numbers.append(found)
        self.times.append(now)
        self.values.append(value)
        self.fresh = True

    def lost(self) -> int | None:
        """How many samples are missing among them; None where their publisher does not count."""
        return lost(list(self._numbers)) if self._numbers else None


class Watch:
    """Listens to the keys of a verb. `measure` gives a sample's value, or None for one that has none; `excuse` says
    what is wrong with those, if there were any.
    """

    def __init__(
        self,
        args: "argparse.Namespace",
        measure: "Measure",
        report: "Callable[[Window], Report]",
        excuse: "Callable[[], str]" = str,
    ) -> None:
        self._args, self._measure, self._report, self._excuse = args, measure, report, excuse
        self._windows: dict[str, Window] = {}
        self._lock = threading.Lock()

    def run(self, bus: "Bus", text: "Callable[[Report], str]") -> int:
        """Print reports until told to end."""
        stop = stop_event()
        for name in self._args.keys:
            threading.Thread(target=self._listen, args=(bus.tap(name),), daemon=True).start()
        deadline = self._args.timeout and time.monotonic() + self._args.timeout
        many, keys = (
            len(self._args.keys) > 1 or any("*" in name for name in self._args.keys),
            ", ".join(self._args.keys),
        )
        near: str | None = None  # looked up when nothing came
        while not stop.wait(EVERY):
            reports = self._reports()
            for name, told in reports.items():
                head = printable(f"{name}: ") if many else ""
                print(json.dumps({"key": name, **told}) if self._args.json else head + text(told), flush=True)
            if reports and self._args.once:
                return 0
            if not reports and near is None:
                near = meant(bus, self._args.keys)
            if not reports and deadline and time.monotonic() > deadline:
                nothing = f"nothing came on {keys} within {self._args.timeout:g} s at {bus.where}{near}"
                say(f"holozen {self._args.node.replace('_', ' ')}: {self._excuse() or nothing}")
                return 1
            if not reports:
                say(self._excuse() or f"no new messages on {keys}{near or ''}")
        return 0

    def _listen(self, tap: "Tap") -> None:
        while True:
            try:
                sample = tap.recv()
            except BusError:
                return
            now = time.monotonic()
            value = self._measure(sample, now)
            if value is None:
                continue
            with self._lock:
                if sample.key not in self._windows:
                    self._windows[sample.key] = Window(self._args.window)
                self._windows[sample.key].add(sample, now, value)

    def _reports(self) -> "dict[str, Report]":
        """Of each key on which something came since the last time."""
        with self._lock:
            fresh = {name: window for name, window in sorted(self._windows.items()) if window.fresh}
            told = {name: self._report(window) | {"lost": window.lost()} for name, window in fresh.items()}
            for window in fresh.values():
                window.fresh = False
        return {name: report for name, report in told.items() if len(report) > 1}


def watch(
    args: "argparse.Namespace",
    measure: "Measure",
    report: "Callable[[Window], Report]",
    text: "Callable[[Report], str]",
) -> int:
    """Run a verb that needs nothing but its samples."""
    with open_bus(args) as bus:
        return Watch(args, measure, report).run(bus, text)


def lost_words(report: "Report") -> str:
    """The end of a report: how many were lost, where that is known."""
    return "" if report["lost"] is None else f" lost: {report['lost']}"


def arguments(parser: "argparse.ArgumentParser", size: int) -> None:
    """The flags that these verbs share. `size`: how many samples by default."""
    add = parser.add_argument
    add("keys", type=key, nargs="+", metavar="KEY", help="keys or key expressions, such as odom or */odom")
    told = f"of the last N messages (default: {size})"
    add("-w", "--window", type=count(2), default=size, metavar="N", help=told)
    add("-1", "--once", action="store_true", help="end after the first report")
    add("--timeout", type=number(0.01, 1e6, "s"), metavar="S", help="exit code 1 after S seconds without any")
