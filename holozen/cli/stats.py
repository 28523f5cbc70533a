"""`holozen topic hz`, `bw` and `delay`: the rate, size and age of messages."""

from __future__ import annotations

import argparse
import json
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

from holozen.bus import Bus
from holozen.cli.hints import suggest_key
from holozen.cli.verb import Verb, by_name, open_bus
from holozen.console import Failure, printable, report
from holozen.flags import count, key, number
from holozen.output import SampleReader
from holozen.process import stop_event
from holozen.transport.samples import RawSubscriber, Sample, until_closed

Report = dict[str, Any]
Measure = Callable[[Sample, float], float | None]

EVERY = 1.0  # s between two reports
PERCENTILES = (50, 95, 99)
WINDOW = 10_000  # messages of hz and delay, as in ROS 2
BYTES_WINDOW = 100  # messages of bw, as in ROS 2
NEAR = 86_400.0  # s; a stamp this close to the wall clock was taken from it


def spread(values: list[float]) -> dict[str, float]:
    """mean, min, max, std_dev (of the population), p50, p95, p99 of at least one value."""
    ordered, mean = sorted(values), sum(values) / len(values)
    deviation = math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
    summary = {"mean": mean, "min": ordered[0], "max": ordered[-1], "std_dev": deviation}
    return summary | {f"p{rank}": percentile(ordered, rank) for rank in PERCENTILES}


def percentile(ordered: list[float], rank: float) -> float:
    """The smallest of the sorted values that at least `rank` % of them do not exceed (nearest-rank
    method).
    """
    return ordered[max(0, math.ceil(len(ordered) * rank / 100) - 1)]


def jitter(values: list[float]) -> float:
    """The mean absolute difference of consecutive values: RFC 3550's |D(i-1, i)|, not smoothed."""
    steps = [abs(later - earlier) for earlier, later in pairwise(values)]
    return sum(steps) / len(steps) if steps else 0.0


def lost(numbers: list[tuple[str, int]]) -> int:
    """The number of samples missing between the first and the last of each source; `numbers` are
    Sample.number, which may begin anew.
    """
    runs: list[set[int]] = []
    newest: dict[str, set[int]] = {}  # the last run of each source
    for source, place in numbers:
        if place == 0 or source not in newest:
            newest[source] = set()
            runs.append(newest[source])
        newest[source].add(place)
    return sum(max(run) - min(run) + 1 - len(run) for run in runs)


class Window:
    """The last samples of one key: their arrival times (s, monotonic), measured values and sequence
    numbers.
    """

    def __init__(self, size: int) -> None:
        self.times: deque[float] = deque(maxlen=size)
        self.values: deque[float] = deque(maxlen=size)
        self._numbers: deque[tuple[str, int]] = deque(maxlen=size)
        self.fresh = False  # whether a sample arrived since the last report

    def add(self, sample: Sample, now: float, value: float) -> None:
        """Add a sample that arrived at `now`."""
        if found := sample.number:
            self._numbers.append(found)
        self.times.append(now)
        self.values.append(value)
        self.fresh = True

    def lost(self) -> int | None:
        """The number of missing samples; None if the publisher does not number them."""
        return lost(list(self._numbers)) if self._numbers else None


class Watch:
    """Listens to the keys of a verb. `measure` returns the value of a sample, None if it has none;
    `excuse` returns why samples had none, empty if all had one.
    """

    def __init__(
        self,
        args: argparse.Namespace,
        measure: Measure,
        report: Callable[[Window], Report],
        excuse: Callable[[], str] = str,
    ) -> None:
        self._args, self._measure, self._report, self._excuse = args, measure, report, excuse
        self._windows: dict[str, Window] = {}
        self._lock = threading.Lock()

    def run(self, bus: Bus, text: Callable[[Report], str]) -> None:
        """Print reports until interrupted. Raises Failure if there is no first one within
        --timeout.
        """
        stop = stop_event()
        for name in self._args.keys:
            threading.Thread(
                target=self._listen, args=(bus.subscribe_raw(name),), daemon=True
            ).start()
        deadline = self._args.timeout and time.monotonic() + self._args.timeout
        keys = ", ".join(self._args.keys)
        many = len(self._args.keys) > 1 or "*" in keys
        near: str | None = None  # looked up once no messages arrive
        # by the last look: at the first one the clock of the stamps may not have come yet
        excused = False
        while not stop.wait(EVERY):
            reports = self._reports()
            for name, values in reports.items():
                head = printable(f"{name}: ") if many else ""
                print(
                    json.dumps({"key": name, **values}) if self._args.json else head + text(values),
                    flush=True,
                )
            if reports:
                if self._args.once:
                    return
                deadline = None
                continue
            if self._args.once and (why := self._excuse()):
                if excused:
                    raise Failure(why)
                excused = True
                continue
            if near is None:
                near = suggest_key(bus, self._args.keys)
            if deadline and time.monotonic() > deadline:
                raise Failure(
                    self._excuse() or f"no messages on {keys} within {self._args.timeout:g} s{near}"
                )
            report(self._excuse() or f"no new messages on {keys}{near}")

    def _listen(self, subscriber: RawSubscriber) -> None:
        for sample in until_closed(subscriber.recv):
            now = time.monotonic()
            value = self._measure(sample, now)
            if value is None:
                continue
            with self._lock:
                if sample.key not in self._windows:
                    self._windows[sample.key] = Window(self._args.window)
                self._windows[sample.key].add(sample, now, value)

    def _reports(self) -> dict[str, Report]:
        """The reports of the keys that had samples since the last call."""
        with self._lock:
            fresh = {name: window for name, window in sorted(self._windows.items()) if window.fresh}
            reports = {
                name: self._report(window) | {"lost": window.lost()}
                for name, window in fresh.items()
            }
            for window in fresh.values():
                window.fresh = False
        return {name: report for name, report in reports.items() if len(report) > 1}


def watch(
    args: argparse.Namespace,
    measure: Measure,
    report: Callable[[Window], Report],
    text: Callable[[Report], str],
) -> int:
    """Run a verb that measures each sample by itself."""
    with open_bus(args) as bus:
        Watch(args, measure, report).run(bus, text)
    return 0


def lost_text(report: Report) -> str:
    """The end of a report: the number of lost samples, if known."""
    return "" if report["lost"] is None else f" lost: {report['lost']}"


def _spread_text(report: Report) -> str:
    """The spread of gaps or ages, in seconds."""
    return (
        f"\tmin: {report['min']:.4f}s max: {report['max']:.4f}s std dev: {report['std_dev']:.5f}s"
        f" window: {report['window']}\n"
        f"\tp50: {report['p50']:.4f}s p95: {report['p95']:.4f}s p99: {report['p99']:.4f}s"
        f" jitter: {report['jitter']:.5f}s{lost_text(report)}"
    )


def hz(args: argparse.Namespace) -> int:
    """Print the average rate and the spread of the intervals between messages, once a second."""
    return watch(args, lambda _sample, now: now, lambda window: rate(list(window.times)), rate_text)


def rate(times: list[float]) -> Report:
    """The rate in Hz of arrivals at `times` (s), and the spread of their gaps (s). Empty for fewer
    than two.
    """
    gaps = [later - earlier for earlier, later in pairwise(times)]
    if not gaps:
        return {}
    gap = spread(gaps)
    return {
        "rate": 1 / gap["mean"] if gap["mean"] else 0.0,
        **gap,
        "jitter": jitter(gaps),
        "window": len(times),
    }


def rate_text(report: Report) -> str:
    """A report in the format of ROS 2, with an extra line."""
    return f"average rate: {report['rate']:.3f}\n{_spread_text(report)}"


def bw(args: argparse.Namespace) -> int:
    """Print the bandwidth and the spread of the message sizes, once a second."""
    return watch(args, lambda sample, _now: float(sample.size), bandwidth, bandwidth_text)


def bandwidth(window: Window) -> Report:
    """The bandwidth in bytes per second, and the spread of the sizes in bytes. Empty for fewer than
    two messages.
    """
    sizes, times = list(window.values), list(window.times)
    span = times[-1] - times[0]
    if len(sizes) < 2:
        return {}
    average = sum(sizes[1:]) / span if span else 0.0  # the first message only starts the interval
    return {
        "bytes_per_second": average,
        **spread(sizes),
        "jitter": jitter(sizes),
        "window": len(sizes),
    }


def bandwidth_text(report: Report) -> str:
    """A report in the format of ROS 2, with an extra line."""
    return (
        f"{size(report['bytes_per_second'])}/s from {report['window']} messages\n"
        f"\tMessage size mean: {size(report['mean'])} min: {size(report['min'])} max: "
        f"{size(report['max'])}\n"
        f"\tp50: {size(report['p50'])} p95: {size(report['p95'])} p99: {size(report['p99'])}"
        f" jitter: {size(report['jitter'])}{lost_text(report)}"
    )


def size(count: float) -> str:
    """A number of bytes in a readable unit; 1 KB is 1000 B."""
    for unit in ("B", "KB", "MB"):
        if count < 1000:
            return f"{count:.0f} B" if unit == "B" else f"{count:.2f} {unit}"
        count /= 1000
    return f"{count:.2f} GB"


class SimClock:
    """The sim's time, extrapolated from the latest message on its key `clock` and the pace of its
    time.
    """

    def __init__(self) -> None:
        self._latest: tuple[float, float] | None = None
        self._pace = 1.0

    def see(self, seconds: float, now: float) -> None:
        """The sim's clock read `seconds` at `now` (s, monotonic)."""
        if self._latest and now > self._latest[1]:
            pace = (seconds - self._latest[0]) / (now - self._latest[1])
            self._pace += 0.1 * (min(max(pace, 0.0), 100.0) - self._pace)
        self._latest = seconds, now

    def time(self, now: float) -> float | None:
        """The sim's time at `now`; None before its first message."""
        return self._latest and self._latest[0] + (now - self._latest[1]) * self._pace


class Delays:
    """Measures the age of messages, each by the clock that stamped it."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self._reader, self._sim = bus, SampleReader(), SimClock()
        self._clock: threading.Thread | None = None
        self.by: set[str] = set()  # the clocks in use
        self.unstamped = self.clockless = (
            0  # messages without a stamp, and with one of an unknown clock
        )

    def measure(self, sample: Sample, now: float) -> float | None:
        """The age of a sample in seconds; None if it has no stamp, or its clock is not known
        yet.
        """
        stamp = stamp_of(self._reader.read(sample, self._bus))
        if stamp is None:
            self.unstamped += 1
            return None
        wall = time.time()
        if abs(wall - stamp) < NEAR:
            self.by.add("the wall clock of this machine")
            return wall - stamp
        if self._clock is None:
            self._clock = threading.Thread(
                target=self._follow, args=(self._bus.subscribe_raw("clock"),), daemon=True
            )
            self._clock.start()
        sim_time = self._sim.time(now)
        if sim_time is None:
            self.clockless += 1
            return None
        self.by.add("the sim's clock (key clock)")
        return sim_time - stamp

    def excuse(self) -> str:
        """Why some messages have no age; empty if all have one."""
        if self.unstamped:
            return f"{self.unstamped} messages have no header.stamp, and so no age"
        text = (
            f"{self.clockless} messages have stamps by another clock than this machine's, and "
            "nothing comes on clock"
        )
        return text if self.clockless else ""

    def _follow(self, subscriber: RawSubscriber) -> None:
        for sample in until_closed(subscriber.recv):
            value = self._reader.read(sample, self._bus)
            clock = value.get("clock") if isinstance(value, dict) else None
            if (seconds := _seconds(clock)) is not None:
                self._sim.see(seconds, time.monotonic())


def stamp_of(value: Any) -> float | None:
    """A message's header.stamp in seconds; None if it has none."""
    header = value.get("header") if isinstance(value, dict) else None
    return _seconds(header.get("stamp") if isinstance(header, dict) else None)


def _seconds(time: Any) -> float | None:
    if not isinstance(time, dict):
        return None
    sec, nanosec = time.get("sec"), time.get("nanosec")
    if not isinstance(sec, int) or not isinstance(nanosec, int) or not (sec or nanosec):
        return None
    return float(sec + nanosec * 1e-9)


def delay(args: argparse.Namespace) -> int:
    """Print the age of messages, once a second."""
    with open_bus(args) as bus:
        delays = Delays(bus)

        def row(window: Window) -> Report:
            ages = list(window.values)
            return {
                **spread(ages),
                "jitter": jitter(ages),
                "window": len(ages),
                "clock": ", ".join(sorted(delays.by)),
            }

        Watch(args, delays.measure, row, delays.excuse).run(bus, delay_text)
    if delays.unstamped:
        report(delays.excuse())
    return 0


def delay_text(report: Report) -> str:
    """A report in the format of ROS 2, with an extra line."""
    return f"average delay: {report['mean']:.4f}\n{_spread_text(report)}\n\tby {report['clock']}"


def _arguments(parser: argparse.ArgumentParser, size: int = WINDOW) -> None:
    """The flags that these verbs share. `size`: the default number of samples."""
    add = parser.add_argument
    add(
        "keys",
        type=key,
        nargs="+",
        metavar="KEY",
        help="keys or key expressions, such as odom or */odom",
    )
    text = f"measure the last N messages (default: {size})"
    add("-w", "--window", type=count(2), default=size, metavar="N", help=text)
    add("-1", "--once", action="store_true", help="end after the first report")
    add(
        "--timeout",
        type=number(0.01, 1e6, "s"),
        metavar="S",
        help="exit code 1 after S seconds without any",
    )


VERBS = by_name(
    Verb(
        "topic hz",
        "measure the rate of messages, their jitter, and how many are lost",
        "odom",
        _arguments,
        hz,
    ),
    Verb(
        "topic bw",
        "measure the bandwidth, and the sizes of messages",
        "odom",
        partial(_arguments, size=BYTES_WINDOW),
        bw,
    ),
    Verb("topic delay", "measure the age of messages on arrival", "odom", _arguments, delay),
)
