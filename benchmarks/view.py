"""What looking costs: a hundred robots that drive, in the page of `holozen view`.

The sim runs in real time, and another process commands each robot four times a second. In turns, a view with an open
page is there or not. Times are processor time: of the sim's process for a second of its own time, and of the view's
for a second of real time. The page takes all that it is sent, and draws nothing.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import viser
import websockets.sync.client as websockets

from benchmarks.company import beside, guest, meeting_point, until
from benchmarks.fleet import drive
from benchmarks.report import Case, parser, publish
from holozen import data
from holozen.bus import Bus
from holozen.messages import Odometry, SimulationStatus

AIM = "the sim needs at most 1 / 0.95 of its time; the view at most 0.6 of a core"
SECONDS = 4.0  # of a turn
TICKS = os.sysconf("SC_CLK_TCK")


@contextmanager
def started(endpoint: str, verb: str, *words: str) -> Iterator[tuple[int, Path]]:
    """Runs a verb in this block: its process id, and the file of what it prints."""
    with tempfile.NamedTemporaryFile() as file:
        command = [sys.executable, "-m", "holozen", verb, *words, "--connect", endpoint, "--listen", endpoint]
        process = subprocess.Popen(command, stdout=file, stderr=file)
        try:
            yield process.pid, Path(file.name)
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait()


def used(process: int) -> float:
    """Seconds of processor time that a process has had, in all its threads."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def page(address: str) -> None:
    """A page that takes what it is sent."""
    name = f"viser-v{viser.__version__}"
    with websockets.connect(address.replace("http", "ws"), subprotocols=[name], max_size=None) as socket:  # type: ignore[list-item]
        for _ in socket:
            pass


class Sim:
    """A running sim, measured from outside."""

    def __init__(self, bus: Bus, process: int) -> None:
        self._status, self._process = bus.latest("simulation_status", SimulationStatus), process

    def seconds(self) -> float:
        """Its own time, as of a status that has just come."""
        assert self._status.wait(self._status.count, 5.0)
        status = self._status.read()[0]
        assert status is not None
        return status.time

    def cost(self, seconds: float, other: int = 0) -> tuple[float, float, float]:
        """Over so many seconds: processor time a second of its own, real-time factor, and the load by `other`."""
        began, own, work, others = time.monotonic(), self.seconds(), used(self._process), used(other or self._process)
        time.sleep(seconds)
        own, work = self.seconds() - own, used(self._process) - work
        real, others = time.monotonic() - began, used(other or self._process) - others
        return work / own, own / real, others / real


def main() -> int:
    args = parser("view", __doc__).parse_args()
    robots, turns, seconds = (5, 1, 0.5) if args.quick else (100, 5, SECONDS)
    endpoint, loads = meeting_point(), list[float]()
    factors: dict[str, list[float]] = {"with": [], "without": []}
    with started(endpoint, "sim", "--empty") as (process, _), Bus("meter", guest(endpoint)) as bus:
        sim = Sim(bus, process)
        until(bus.endpoints)
        robot = str(data.find("urdf", "hb_bot.urdf.xacro"))
        words = ["spawn", robot, "--count", str(robots), "--connect", endpoint, "--timeout", "20"]
        subprocess.run([sys.executable, "-m", "holozen", *words], check=True, capture_output=True)
        odom = bus.latest(f"bot{robots - 1}/odom", Odometry)

        def moving() -> bool:
            last = odom.read()[0]
            return last is not None and last.twist.twist.linear.x > 0.1

        def without() -> list[float]:
            cost, factor, _ = sim.cost(seconds)
            factors["without"].append(factor)
            return [cost]

        def looked_at() -> list[float]:
            with started(endpoint, "view", "--port", "0") as (view, printed):
                until(lambda: "http://" in printed.read_text())
                address = next(word for word in printed.read_text().split() if word.startswith("http://"))
                with beside(page, address):
                    time.sleep(2.0 if not args.quick else 0.5)  # all robots are in the page
                    cost, factor, load = sim.cost(seconds, view)
            factors["with"].append(factor)
            loads.append(load)
            return [cost]

        with beside(drive, endpoint, robots):
            until(moving)
            case = Case(f"{robots} robots", "s a second of the sim", AIM).take_turns(
                turns, view=looked_at, no_view=without
            )
    print(f"the view's load of a core: {', '.join(f'{load:.2f}' for load in loads)}")
    print("real-time factor", {side: [round(factor, 3) for factor in found] for side, found in factors.items()})
    publish("view", [case], args.json, loads=loads, factors=factors)
    return 0


if __name__ == "__main__":
    sys.exit(main())
