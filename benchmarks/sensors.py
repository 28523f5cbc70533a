"""What sensors cost a sim that keeps real time: a lidar of 360 rays and a camera of 640 x 480, both
at 10 Hz, on one robot that is driven at 20 Hz. They are read, or not, in turns, in the same sim:
without a reader, they are not made.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.company import processor_time
from benchmarks.report import Case, parser, publish
from holozen.bus import Bus
from holozen.data import find
from holozen.messages import CommandStatus, Image, LaserScan, Message, SimulationStatus, Twist
from holozen.testing import Wire, wait_for

AIM = "real-time factor 1, no overruns, command age p99 below 50 ms"
READ: dict[str, dict[str, type[Message]]] = {
    "lidar": {"scan": LaserScan},
    "camera": {"camera/image_raw": Image},
    "both": {"scan": LaserScan, "camera/image_raw": Image},
}
PERIOD = 0.05  # s between two commands
LARGE = 4_000_000  # bytes


def robot() -> str:
    """explorer with a camera of 640 x 480, in a file beside the others."""
    text = find("urdf", "explorer.urdf.xacro").read_text()
    return text.replace("<width>320<", "<width>640<").replace("<height>240<", "<height>480<")


@contextmanager
def read(bus: Bus, keys: dict[str, type[Message]]) -> Iterator[dict[str, Any]]:
    """Subscribe until all of these come."""
    found = {key: bus.subscribe(key, kind, depth=1000, limit=LARGE) for key, kind in keys.items()}
    for subscription in found.values():
        wait_for(subscription.try_recv, 60.0, "the first message of a sensor")
    try:
        yield found
    finally:
        for subscription in found.values():
            subscription.close()


class Driven:
    """The sim's robot, which is driven, and the figures that the sim reports meanwhile."""

    def __init__(self, bus: Bus, pid: int) -> None:
        self._bus, self._pid = bus, pid
        self._commands = bus.publisher("cmd_vel", Twist)
        self._statuses = bus.subscribe("cmd_vel_status", CommandStatus, depth=1000)
        self._times = bus.subscribe("simulation_status", SimulationStatus, depth=1000)
        self.figures: dict[str, dict[str, float]] = {}

    def drive(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            self._commands.put(Twist.planar(0.2, 0.0, 0.5))
            time.sleep(PERIOD)

    def measure(self, name: str, keys: dict[str, type[Message]], seconds: float) -> list[float]:
        """Milliseconds of the sim's processor time in a second of real time, while these are
        read.
        """
        with read(self._bus, keys) as found:
            self.drive(0.5)
            for subscription in (self._statuses, self._times, *found.values()):
                while subscription.try_recv():
                    pass
            began, at = processor_time(self._pid), time.monotonic()
            self.drive(seconds)
            took = time.monotonic() - at
            cost = (processor_time(self._pid) - began) / took * 1000
            self._report(
                name,
                took,
                {key: sum(1 for _ in iter(one.try_recv, None)) for key, one in found.items()},
            )
        return [cost]

    def _report(self, name: str, took: float, counts: dict[str, int]) -> None:
        statuses = [one.message for one in iter(self._statuses.try_recv, None) if one.message]
        times = [one.message for one in iter(self._times.try_recv, None) if one.message]
        ages = sorted(
            source.delay * 1000 for status in statuses for source in status.sources if source.obeyed
        )
        worst = self.figures.setdefault(
            name, {"command_age_p99_ms": 0.0, "overruns": 0.0, "real_time_factor": 1.0}
        )
        worst["command_age_p99_ms"] = max(
            worst["command_age_p99_ms"], ages[int(0.99 * (len(ages) - 1))]
        )
        worst["overruns"] += times[-1].overruns - times[0].overruns
        factor = (times[-1].time - times[0].time) / (took * (len(times) - 1) / len(times))
        worst["real_time_factor"] = min(worst["real_time_factor"], factor)
        worst |= {f"{key}_hz": count / took for key, count in counts.items()}


def main() -> int:
    args = parser("sensors", __doc__).parse_args()
    turns, seconds = (1, 1.0) if args.quick else (5, 4.0)
    cases = []
    with Wire() as wire, tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "explorer.urdf.xacro"
        path.write_text(robot())
        sim = wire.start("sim", "--robot", str(path), "--package", f"holo={find('urdf').parent}")
        sim.wait_for_line("listens on")
        driven = Driven(wire.bus("bench"), sim.pid)
        driven.drive(1.0)
        for name, keys in READ.items():
            case = Case(f"with {name}", "ms of the sim's processor time a second", AIM)
            cases.append(
                case.take_turns(
                    turns,
                    read=lambda name=name, keys=keys: driven.measure(name, keys, seconds),  # type: ignore[misc]
                    not_read=lambda: driven.measure("nothing", {}, seconds),
                )
            )
    for name, figures in driven.figures.items():
        print(
            f"{name}: "
            + ", ".join(f"{key.replace('_', ' ')} {value:.3g}" for key, value in figures.items())
        )
    publish("sensors", cases, args.json, figures=driven.figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
