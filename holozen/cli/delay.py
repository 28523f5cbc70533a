"""`holozen topic delay`: how old messages are when they come, by their header.stamp."""

import threading
import time

from holozen.cli.noun import Verb, open_bus
from holozen.cli.reading import Reader
from holozen.cli.spread import jitter, spread
from holozen.cli.watch import Watch, Window, arguments, lost_words
from holozen.errors import BusError
from holozen.tell import say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse
    from typing import Any

    from holozen.bus import Bus
    from holozen.cli.watch import Report
    from holozen.tap import Sample

WINDOW = 10_000  # messages, as in ROS 2
NEAR = 86_400.0  # s; a stamp this near to the wall clock is of that


class SimClock:
    """The sim's time, from its key `clock`: the newest message, and how fast the sim's time goes."""

    def __init__(self) -> None:
        self._told: tuple[float, float] | None = None
        self._pace = 1.0

    def see(self, told: float, now: float) -> None:
        """The sim said that it is `told` seconds, at `now` (s, monotonic)."""
        if self._told and now > self._told[1]:
            pace = (told - self._told[0]) / (now - self._told[1])
            self._pace += 0.1 * (min(max(pace, 0.0), 100.0) - self._pace)
        self._told = told, now

    def time(self, now: float) -> float | None:
        """The sim's time at `now`; None before it was heard."""
        return self._told and self._told[0] + (now - self._told[1]) * self._pace


class Delays:
    """Measures ages, each by the clock that its stamp was read off."""

    def __init__(self, bus: "Bus") -> None:
        self._bus, self._reader, self._sim = bus, Reader(), SimClock()
        self._clock: threading.Thread | None = None
        self.by: set[str] = set()  # the clocks that were used
        self.unstamped = self.clockless = 0  # messages without a stamp, and with one by a clock that is not heard

    def measure(self, sample: "Sample", now: float) -> float | None:
        """The age of a sample in seconds; None where it has no stamp, or no clock is known for it yet."""
        stamp = stamp_of(self._reader.read(sample, self._bus))
        if stamp is None:
            self.unstamped += 1
            return None
        wall = time.time()
        if abs(wall - stamp) < NEAR:
            self.by.add("the wall clock of this machine")
            return wall - stamp
        self._hear_the_sim()
        told = self._sim.time(now)
        if told is None:
            self.clockless += 1
            return None
        self.by.add("the sim's clock (key clock)")
        return told - stamp

    def excuse(self) -> str:
        """Why messages have no age; empty if all have."""
        if self.unstamped:
            return f"{self.unstamped} messages have no header.stamp, and so no age"
        told = f"{self.clockless} messages have stamps by another clock than this machine's, and nothing comes on clock"
        return told if self.clockless else ""

    def _hear_the_sim(self) -> None:
        if self._clock is None:
            self._clock = threading.Thread(target=self._follow, args=(self._bus.tap("clock"),), daemon=True)
            self._clock.start()

    def _follow(self, tap: "Any") -> None:
        while True:
            try:
                sample = tap.recv()
            except BusError:
                return
            value = self._reader.read(sample, self._bus)
            told = value.get("clock") if isinstance(value, dict) else None
            if (seconds := _seconds(told)) is not None:
                self._sim.see(seconds, time.monotonic())


def stamp_of(value: "Any") -> float | None:
    """The seconds of a message's header.stamp; None where it has none."""
    header = value.get("header") if isinstance(value, dict) else None
    return _seconds(header.get("stamp") if isinstance(header, dict) else None)


def _seconds(time: "Any") -> float | None:
    if not isinstance(time, dict):
        return None
    sec, nanosec = time.get("sec"), time.get("nanosec")
    if not isinstance(sec, int) or not isinstance(nanosec, int) or not (sec or nanosec):
        return None
    return float(sec + nanosec * 1e-9)


def delay(args: "argparse.Namespace") -> int:
    """Print how old messages are, once a second."""
    with open_bus(args) as bus:
        delays = Delays(bus)

        def report(window: Window) -> "Report":
            ages = list(window.values)
            return {**spread(ages), "jitter": jitter(ages), "window": len(ages), "clock": ", ".join(sorted(delays.by))}

        code = Watch(args, delays.measure, report, delays.excuse).run(bus, text)
    if delays.unstamped and not code:
        say(delays.excuse())
    return code


def text(report: "Report") -> str:
    """A report as ROS 2 shows it, and a line more."""
    return (
        f"average delay: {report['mean']:.4f}\n"
        f"\tmin: {report['min']:.4f}s max: {report['max']:.4f}s std dev: {report['std_dev']:.5f}s"
        f" window: {report['window']}\n"
        f"\tp50: {report['p50']:.4f}s p95: {report['p95']:.4f}s p99: {report['p99']:.4f}s"
        f" jitter: {report['jitter']:.5f}s{lost_words(report)}\n\tby {report['clock']}"
    )


def _arguments(parser: "argparse.ArgumentParser") -> None:
    arguments(parser, WINDOW)


VERBS = {"delay": Verb("how old messages are when they come", "holozen topic delay odom", _arguments, delay)}
