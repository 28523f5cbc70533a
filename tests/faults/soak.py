"""Drives, spawns, deletes, cuts, kills, stops and reconnects at random, and checks the whole
history afterwards.

python -m tests.faults.soak MINUTES [SEED] [--plot FILE]

The link between drivers and sim is the tests' proxy. Figures are those of the sim's process.
"""

import argparse
import contextlib
import os
import random
import signal
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import zenoh

from holozen.messages import TriggerReply, TriggerRequest
from holozen.messages import simulation_interfaces as si
from holozen.testing import Process, Wire
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.samples import Sample, Stamp
from tests.integration.robots import sent_at

from .history import STEP, History, Violation, wait_for_motion, whole_lines
from .proxy import Proxy

HERE = Path(__file__).parent
EVERY = 5.0  # s between two figures
BURST = 40  # robots that come and go in a row
NAMES = [f"bot{number}" for number in range(8)]
"""Of spawned robots. Few, since Zenoh keeps each key that it has told over a link until that link
ends.
"""
BEFORE, AFTER = 2.0, 0.2  # s around a violation that are printed
BOT = """<robot name="bot"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<gazebo><plugin name="drive" filename="libgazebo_ros_planar_move.so"/></gazebo></robot>"""
WRONG = (
    b"",
    b"\x00" * 1000,
    b'{"linear": {"x": NaN}}',
    b'{"linear": {"x": 1e308}}',
    b'{"linear": {"x": 5',
    b"[" * 60_000,
    b'{"speed": 1}',
    b"9" * 70_000,
    b'{"linear": {"x": "fast"}}',
)
"""Commands that move nothing, and stop nothing either."""


class Figures(NamedTuple):
    """Of a process: memory in MB, threads, descriptors."""

    at: float
    memory: float
    threads: float
    descriptors: float

    @classmethod
    def of(cls, pid: int) -> "Figures":
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        rows = dict(line.split(":", 1) for line in lines)
        memory, threads = int(rows["VmRSS"].split()[0]) / 1024, int(rows["Threads"])
        return cls(time.monotonic(), memory, threads, len(os.listdir(f"/proc/{pid}/fd")))


class Soak:
    """One run: what was done, and what was found wrong."""

    def __init__(self, wire: Wire, proxy: Proxy, seed: int) -> None:
        self.random, self._wire, self._proxy = random.Random(seed), wire, proxy
        self.sim = wire.start("sim")
        self.sim.wait_for_line("listens on cmd_vel", 60)
        assert wire.run("param", "set", "sim", "odometry_rate", f"{1 / STEP:g}").returncode == 0
        self._bus = wire.bus("soak")
        self.observer = Process([sys.executable, str(HERE / "observer.py"), wire.endpoint])
        self.drivers: list[Process] = []
        self.names: list[str] = []
        self.acts: list[tuple[float, float, str]] = []  # when each began and ended
        self.restored: list[float] = []  # when the link came back
        # when each command came past the sim, and was sent
        self.passed: list[tuple[float, float, Stamp]] = []
        self.stopped: list[tuple[float, float]] = []  # from the reply of a stop to the release
        self.figures: list[Figures] = []
        self.done: Counter[str] = Counter()
        self.spawned = 0
        self.wrong: list[str] = []
        self._bus.session.declare_subscriber("cmd_vel", self._pass)

    def _pass(self, sample: zenoh.Sample) -> None:
        if stamp := (passed := Sample(sample, 1)).stamp:
            self.passed.append((time.monotonic(), sent_at(passed), stamp))

    def run(self, seconds: float) -> None:
        acts: list[Callable[[], None]] = [
            self.drive,
            self.drive,
            self.drive,
            self.kill,
            self.suspend,
            self.stall,
            self.lose,
            self.reset,
            self.delay,
            self.stop,
            self.spawn,
            self.spawn,
            self.spawn_many,
            self.spawn_many,
            self.delete,
            self.malform,
            self.look,
        ]
        self.drive()
        wait_for_motion(self.observer, 0.0)  # else a short run may try nothing
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if not self.figures or time.monotonic() - self.figures[-1].at > EVERY:
                self.figures.append(Figures.of(self.sim.pid))
            act = self.random.choice(acts)
            self.done[act.__name__] += 1
            began = time.monotonic()
            act()
            self.acts.append((began, time.monotonic(), act.__name__))
            time.sleep(self.random.uniform(0.05, 0.4))
        for driver in self.drivers:
            driver.close()
        time.sleep(1.0)  # in which it has to stand
        self.observer.close()

    @property
    def _alive(self) -> list[Process]:
        return [driver for driver in self.drivers if driver.returncode is None]

    def drive(self) -> None:
        if len(self._alive) < 2:
            self.drivers.append(
                Process([sys.executable, str(HERE / "driver.py"), self._proxy.endpoint])
            )
            time.sleep(self.random.uniform(0.5, 2.0))

    def kill(self) -> None:
        for driver in self._alive:
            driver.signal(self.random.choice([signal.SIGKILL, signal.SIGTERM, signal.SIGINT]))
            driver.close()

    def suspend(self) -> None:
        for driver in self._alive[:1]:
            driver.signal(signal.SIGSTOP)
            time.sleep(self.random.uniform(0.1, 1.5))
            driver.signal(signal.SIGCONT)

    def stall(self) -> None:
        self._proxy.stall()
        time.sleep(self.random.uniform(0.1, 1.5))
        self.restored.append(time.monotonic())
        self._proxy.resume()

    def lose(self) -> None:
        """Make connections half-open: whatever was sent is lost, and so is all that follows on
        them.
        """
        self._proxy.set(lost=True)
        time.sleep(self.random.uniform(0.1, 1.0))
        self.restored.append(time.monotonic())
        self._proxy.set(lost=False)

    def reset(self) -> None:
        """Reset all connections, with no silence in between."""
        self.restored.append(time.monotonic())
        self._proxy.reset()

    def delay(self) -> None:
        self._proxy.set(delay=self.random.uniform(0.0, 0.8), jitter=0.1)
        time.sleep(self.random.uniform(0.2, 1.0))
        self._proxy.set(delay=0.0, jitter=0.0)

    def stop(self) -> None:
        """Stop and release the robot. Afterwards only a driver that has let go may drive, so these
        end.
        """
        self._bus.call("stop", TriggerRequest(), TriggerReply, 20.0)
        since = time.monotonic()
        time.sleep(self.random.uniform(0.1, 1.0))
        self.stopped.append((since, time.monotonic()))
        self.kill()
        self._bus.call("release", TriggerRequest(), TriggerReply, 20.0)
        with contextlib.suppress(ServiceError):  # someone drives
            self._bus.call("resume", TriggerRequest(), TriggerReply, 20.0)

    def spawn(self) -> None:
        unused = sorted({*NAMES} - {*self.names})
        if not unused:
            return self.delete()
        self._spawn(self.random.choice(unused))

    def _spawn(self, name: str) -> None:
        request = si.SpawnEntityRequest(name, resource_string=BOT)
        request.initial_pose.pose.position.x = 500.0 + 5.0 * NAMES.index(name)
        self._bus.call("spawn_entity", request, si.SpawnEntityReply, 20.0)
        self.names.append(name)
        self.spawned += 1

    def spawn_many(self) -> None:
        """Spawn many robots, each of which is deleted at once."""
        self.delete()
        for _ in range(BURST):
            self.spawn()
            self.delete()

    def delete(self) -> None:
        if self.names:
            name = self.names.pop(self.random.randrange(len(self.names)))
            self._bus.call(
                "delete_entity", si.DeleteEntityRequest(name), si.DeleteEntityReply, 20.0
            )

    def malform(self) -> None:
        for payload in self.random.choices(WRONG, k=5):
            self._bus.session.put("cmd_vel", payload, priority=zenoh.Priority.REAL_TIME)

    def look(self) -> None:
        """Check that each request was applied once: what was spawned is there, and what was deleted
        is not.
        """
        found = self._bus.call(
            "get_entities", si.GetEntitiesRequest(), si.GetEntitiesReply, 20.0
        ).entities
        robots = [name for name in found if name.startswith("bot")]
        if sorted(robots) != sorted(self.names):
            self.wrong.append(f"there are {robots}, and should be {self.names}")
        reader = self._bus.subscribe_raw("**")
        list(self._bus.session.get("odom", timeout=5))
        reader.close()

    def check(self) -> History:
        """Compare all commands sent with all motion."""
        history = History.of(self.drivers, self.observer, 0.0)
        checks: list[Callable[[], None]] = [
            history.check_silence,
            *(partial(history.check_restored, at) for at in self.restored),
        ]
        for check in checks:
            try:
                check()
            except Violation as error:
                self.wrong.append(f"{error}\n{self.story(history, error.at)}")
        for since, until in self.stopped:
            if rows := history.moves(since + STEP, until):
                wrong = f"it moved {len(rows)} times while it was stopped"
                self.wrong.append(f"{wrong}\n{self.story(history, rows[0].end)}")
        times = [float(line.split()[0]) for line in whole_lines(self.observer)]
        if not any(row.moves for row in history.odom):
            self.wrong.append("it never moved: nothing was tried")
        if self.sim.returncode is not None or len(times) < 2:
            self.wrong.append(f"the sim ended with code {self.sim.returncode}")
        if "Traceback" in self.sim.err:
            self.wrong.append("the sim wrote a traceback")
        return history

    def story(self, history: History, at: float) -> str:
        """Everything around a time, in seconds from it: acts, commands sent and passed on, and the
        odom messages between which the robot starts or stops.
        """
        lines = [(began, f"{name}, for {ended - began:.3f} s") for began, ended, name in self.acts]
        lines += [(restored, "the link is back") for restored in self.restored]
        lines += [
            (
                each.began,
                f"driver {each.driver} sends, and is done after {each.ended - each.began:.4f} s",
            )
            for each in history.commands
        ]
        lines += [
            (
                came,
                f"command {stamp.number} of {stamp.session[:6]} comes, sent at "
                f"{sent - at:+.4f}, "
                f"{came - sent:.4f} s old",
            )
            for came, sent, stamp in self.passed
        ]
        lines += [
            (
                row.end,
                f"odom {'moves' if row.moves else 'stands'}, the one before it at "
                f"{row.begin - at:+.4f}",
            )
            for before, row in pairwise(history.odom)
            if before.moves != row.moves
        ]
        return "\n".join(
            f"  {when - at:+.4f} {what}"
            for when, what in sorted(lines)
            if -BEFORE < when - at < AFTER
        )

    def growth(self) -> tuple[float, float, float]:
        """MB an hour, and the change of threads and descriptors, from the second quarter to the
        last.
        """
        quarter = max(1, len(self.figures) // 4)
        early, late = self.figures[quarter : 2 * quarter] or self.figures, self.figures[-quarter:]
        parts = [
            Figures(*map(statistics.median, zip(*part, strict=True))) for part in (early, late)
        ]
        at, memory, threads, descriptors = (
            after - before for before, after in zip(*parts, strict=True)
        )
        return 3600 * memory / max(at, 1.0), threads, descriptors


def soak(minutes: float, seed: int) -> tuple[Soak, History]:
    with Wire() as wire, Proxy(wire.port) as proxy:
        run = Soak(wire, proxy, seed)
        try:
            run.run(60 * minutes)
        except (BusError, ServiceError) as error:
            run.wrong.append(f"a request was neither granted nor refused: {error}")
        finally:
            for process in (*run.drivers, run.observer):
                process.close()
        return run, run.check()


def plot(figures: list[Figures], file: Path) -> None:
    """Draw the memory, threads and descriptors over the time."""
    from matplotlib import pyplot

    minutes = [(each.at - figures[0].at) / 60 for each in figures]
    drawing, (memory, counts) = pyplot.subplots(
        2, sharex=True, figsize=(6, 3.6), layout="constrained"
    )
    memory.plot(minutes, [each.memory for each in figures], linewidth=1)
    memory.set(ylabel="memory in MB", ylim=0)
    counts.plot(minutes, [each.threads for each in figures], linewidth=1, label="threads")
    counts.plot(minutes, [each.descriptors for each in figures], linewidth=1, label="descriptors")
    counts.set(xlabel="minutes", ylim=0)
    counts.legend()
    drawing.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


def main(minutes: float, seed: int, file: Path | None) -> int:
    print(f"seed {seed}", flush=True)
    run, history = soak(minutes, seed)
    moved = sum(row.end - row.begin for row in history.odom if row.moves)
    print(", ".join(f"{count} {name}" for name, count in sorted(run.done.items())))
    came = f"{len(history.commands)} commands, {len(history.odom)} odom, {run.spawned} spawned"
    print(f"{came}; it moved for {moved:.0f} s")
    print(f"it moved on after the last command for at most {history.longest():.3f} s")
    first, last, (memory, threads, descriptors) = run.figures[0], run.figures[-1], run.growth()
    print(
        f"memory {first.memory:.1f} to {last.memory:.1f} MB ({memory:+.1f} MB/h from the second "
        "quarter on), "
        f"threads {first.threads} to {last.threads} ({threads:+g}), "
        f"descriptors {first.descriptors} to {last.descriptors} ({descriptors:+g})"
    )
    print(f"{len(run.wrong)} violations", *run.wrong[:20], sep="\n")
    if file:
        plot(run.figures, file)
    return 1 if run.wrong else 0


if __name__ == "__main__":
    flags = argparse.ArgumentParser("scripts/soak", description=__doc__.splitlines()[0])
    flags.add_argument("minutes", type=float, metavar="MINUTES")
    flags.add_argument("seed", type=int, nargs="?", default=random.randrange(10**6), metavar="SEED")
    flags.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw memory, threads and descriptors"
    )
    given = flags.parse_args()
    sys.exit(main(given.minutes, given.seed, given.plot))
