"""A fleet of planar robots that drive, as fast as the loop goes: 1 to 1000 of them, with odom at 20
Hz of sim time.

Another process commands each robot once a second of sim time, a third one subscribes to `*/odom`.
Beside it, in turns, the bare engine steps the same bodies on the same ground. Time is processor
time of all threads of the sim's process, so the real-time factor is that of one core. Then come
fleets in two processes against one: shards that are read, shards that are not, and bare engines,
which show what the machine can give. The last case is ten pilots among 300 bases on one bus, each
with a beat of its own, against the same among ten: a sender hears the beats of those alone that it
drives. Its third side hears them all.
"""

import math
import re
import sys
import threading
import time
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from benchmarks.company import PROCESSES, beside, client, guest, host, meeting_point, until
from benchmarks.report import Case, parser, publish
from benchmarks.sim_loop import REST, ROBOT, WORLD, Stepper, repeated
from holozen.bus import Bus
from holozen.messages import Clock, Twist
from holozen.robot.files.loading import load
from holozen.robot.model import RobotModel
from holozen.robot.rigid import lump
from holozen.transport.connection import Connection
from services.sim.entities import Entities
from services.sim.loop import Loop
from services.sim.physics.engine import UPRIGHT
from services.sim.physics.world import World

AIM = (
    "300 robots at 5 times real time on one core, 1000 at 1; a robot costs the same, 10 to "
    "1000, within 1.5"
)
FLEETS = (1, 10, 100, 300, 1000)
GRID = 2.0  # m between two robots; each drives a circle of 0.4 m, all in step
COMMAND = Twist.planar(0.2, 0.0, 0.5)
COMMANDED = 1.0  # Hz of sim time, of each robot
SHARDED = 300  # robots of the case with shards
SETTLING = 120  # steps until all stand on the ground
BASES, PILOTS = 300, 10  # on one bus; each pilot drives one base
PILOTED = 20.0  # Hz of each pilot's commands


def places(robots: int) -> list[tuple[float, float, float]]:
    """Where the robots start: on a square grid."""
    side = math.ceil(math.sqrt(robots))
    return [(GRID * (i % side), GRID * (i // side), REST) for i in range(robots)]


def drive(endpoint: str, robots: int, rate: float = COMMANDED) -> None:
    """A pilot of all robots, who commands each `rate` times a second of sim time."""
    with Bus("pilot", guest(endpoint)) as bus:
        commands = [bus.publisher(f"bot{i}/cmd_vel", Twist) for i in range(robots)]
        clock, sent = bus.subscribe("clock", Clock, depth=1), 0
        while True:
            if (message := clock.recv().message) is None:
                continue
            due = int(message.clock.seconds() * rate * robots)
            for number in range(max(sent, due - robots), due):
                commands[number % robots].put(COMMAND)
            sent = due


def watch(endpoint: str) -> None:
    """A reader of all odometry."""
    with Bus("watcher", guest(endpoint)) as bus:
        odoms = bus.subscribe_raw("*/odom")
        while True:
            odoms.recv()


def fleet(
    bus: Bus, world: World, model: RobotModel, robots: int, first: int = 0
) -> tuple[Entities, Stepper]:
    """Our loop with `robots` copies of a robot on their keys, from bot`first` on."""
    entities = Entities(bus, world, (5.0, 10.0))
    for number, at in enumerate(places(robots), first):
        entities.add(f"bot{number}", model, (at, UPRIGHT))
    loop = Loop(bus, world, entities, rtf=0)
    return entities, lambda steps: loop.run(threading.Event(), steps)


def bare(model: RobotModel, robots: int) -> Stepper:
    """The same bodies, and nothing but steps. In a world that is not quite level they keep their
    contacts.
    """
    world, body = World(replace(WORLD, gravity=(1e-9, 0.0, WORLD.gravity[2]))), lump(model)
    for at in places(robots):
        world.add(body, at)
    return repeated(world.step)


def timed(stepper: Stepper, steps: int, robots: int) -> list[float]:
    """Microseconds of processor time for each robot and step."""
    start = time.process_time()
    stepper(steps)
    return [(time.process_time() - start) / steps / robots * 1e6]


def resident() -> int:
    """Bytes of memory that this process has."""
    with open("/proc/self/status") as status:
        return int(re.search(r"VmRSS:\s+(\d+)", status.read())[1]) * 1024  # type: ignore[index]


def measure(robots: int, turns: int, steps: int) -> tuple[Case, dict[str, float]]:
    """One fleet: its case, and the figures without a comparison."""
    model = load(ROBOT)
    assert model.drive is not None
    model = replace(model, drive=replace(model.drive, odometry_rate=20.0, command_timeout=None))
    endpoint, before = meeting_point(), resident()
    with Bus("sim", host(endpoint)) as bus, closing(World(WORLD)) as world:
        start = time.process_time()
        entities, ours = fleet(bus, world, model, robots)
        spawning, memory = time.process_time() - start, resident() - before
        ours(SETTLING)
        with beside(drive, endpoint, robots), beside(watch, endpoint):

            def driving() -> bool:
                ours(12)
                return all(
                    robot.commands.arbiters.base.driver(time.monotonic())
                    for robot in entities.robots
                )

            until(driving, every=0)
            other = bare(model, robots)
            other(SETTLING)
            case = Case(f"{robots} robots", "us a robot and step", AIM).take_turns(
                turns,
                holozen=lambda: timed(ours, steps, robots),
                bare_engine=lambda: timed(other, steps, robots),
            )
    cost = case.sides()["holozen"]["p50"]
    return case, {
        "robots": robots,
        "real_time_factor": 1e6 * WORLD.step / (cost * robots),
        "memory_KB_a_robot": memory / robots / 1000,
        "spawn_ms_a_robot": spawning / robots * 1000,
    }


Share = tuple[int, int, float]
"""Robots of a process, the number of its first one, and for how many seconds it steps them."""


def counted(step: Stepper, share: Share, together: Any, results: Any) -> None:
    """Step a share once all are `together`; the steps of its robots in a second of real time go
    into `results`.
    """
    robots, _, seconds = share
    step(SETTLING)
    together.wait()
    start, steps = time.monotonic(), 0
    while time.monotonic() < start + seconds:
        step(12)
        steps += 12
    results.put(steps * robots / (time.monotonic() - start))
    time.sleep(60)  # until it is ended


def one_shard(endpoint: str, share: Share, together: Any, results: Any) -> None:
    """A sim in a process of its own with some robots."""
    robots, first, _ = share
    with Bus("sim", guest(endpoint)) as bus, closing(World(WORLD)) as world:
        entities, step = fleet(bus, world, load(ROBOT), robots, first)
        for robot in entities.robots:
            robot.commands.arbiters.base.offer(
                "benchmark", 4, (0.2, 0.0, 0.5), time.monotonic() + 1e6
            )
        counted(step, share, together, results)


def one_engine(_endpoint: str, share: Share, together: Any, results: Any) -> None:
    """The bare engine in a process of its own with some bodies."""
    counted(bare(load(ROBOT), share[0]), share, together, results)


def side_by_side(
    job: Any, count: int, sharded: int, seconds: float, is_read: bool = True
) -> list[float]:
    """Microseconds of real time a robot and step, of `sharded` robots in `count` processes at once,
    whose odometry `is_read`.
    """
    results, together, endpoint = PROCESSES.Queue(), PROCESSES.Barrier(count), meeting_point()
    with ExitStack() as sims, Bus("watcher", host(endpoint)) as bus:
        odoms = bus.subscribe_raw("*/odom", depth=1) if is_read else None
        robots = sharded // count
        for number in range(count):
            share = robots, number * robots, seconds
            sims.enter_context(beside(job, endpoint, share, together, results))
        found = [results.get(timeout=300) for _ in range(count)]
        if odoms:
            odoms.close()
    return [1e6 / sum(found)]


def router(endpoint: str) -> None:
    """Where bases and pilots meet."""
    with Bus("router", Connection("router", connect=(), listen=(endpoint,)), lasting=True):
        threading.Event().wait()


def bases(endpoint: str, count: int) -> None:
    """Robots that obey commands, each with a session and a beat of its own."""
    with ExitStack() as buses:
        beats = []
        for number in range(count):
            bus = buses.enter_context(Bus(f"base{number}", client(endpoint), lasting=True))
            bus.subscribe(f"bot{number}/cmd_vel", Twist, depth=1)
            beats.append(bus.beat())
        while True:
            for beat in beats:
                beat.poll()
            time.sleep(0.01)


def pilots(endpoint: str, seconds: float, hears_all: bool, results: Any) -> None:
    """Command a base each. The processor time of a second, in ms, goes into `results`."""
    with ExitStack() as buses:
        commands = []
        for number in range(PILOTS):
            bus = buses.enter_context(Bus(f"pilot{number}", client(endpoint), lasting=True))
            commands.append(bus.publisher(f"bot{number}/cmd_vel", Twist))
            if hears_all:
                bus.subscribe_raw("@holozen/*/beat", depth=1)
        until(lambda: all(command.echoes and command.echoes.heard for command in commands))
        start, begun = time.process_time(), time.monotonic()
        while (passed := time.monotonic() - begun) < seconds:
            for command in commands:
                command.put(COMMAND)
            time.sleep(1 / PILOTED)
        results.put((time.process_time() - start) / passed * 1e3)
        time.sleep(60)  # until it is ended


def piloted(count: int, seconds: float, hears_all: bool = False) -> list[float]:
    """Milliseconds of processor time a second that PILOTS take on a bus with `count` bases."""
    results, endpoint = PROCESSES.Queue(), meeting_point()
    with (
        beside(router, endpoint),
        beside(bases, endpoint, count),
        beside(pilots, endpoint, seconds, hears_all, results),
    ):
        return [results.get(timeout=300)]


def plot(fleets: list[dict[str, float]], cases: list[Case], file: Path) -> None:
    """Plot the cost of a robot and step against the number of robots, beside that of the bare
    engine.
    """
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6, 3.2))
    robots = [row["robots"] for row in fleets]
    for side in ("holozen", "bare engine"):
        axes.plot(robots, [case.sides()[side]["p50"] for case in cases], marker="o", label=side)
    axes.set(xscale="log", ylim=(0, None), xlabel="robots", ylabel="us a robot and step")
    axes.legend()
    axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(file)
    print(f"plot: {file}")


def main() -> int:
    flags = parser("fleet", __doc__)
    flags.add_argument(
        "--robots", type=int, nargs="+", default=FLEETS, metavar="N", help="how many (default: all)"
    )
    flags.add_argument("--plot", type=Path, metavar="FILE", help="draw the costs, as SVG or PNG")
    args = flags.parse_args()
    cases: list[Case] = []
    fleets: list[dict[str, float]] = []
    for robots in args.robots:
        turns, steps = (1, 24) if args.quick else (9, max(240, 12 * (2000 // robots)))
        case, figures = measure(robots, turns, steps)
        cases.append(case)
        fleets.append(figures)
        print(
            ", ".join(f"{name.replace('_', ' ')} {value:.4g}" for name, value in figures.items()),
            flush=True,
        )
    if args.plot:
        plot(fleets, cases, args.plot)
    seconds = 0.2 if args.quick else 3.0
    turns = 1 if args.quick else 5
    sharded = 2 if args.quick else SHARDED
    for name, job, is_read in (
        (f"{sharded} robots in sims", one_shard, True),
        ("the same, unread", one_shard, False),
        ("the same in bare engines", one_engine, False),
    ):
        case = Case(
            name, "us of real time a robot and step", "ratio of two processes to one <= 0.6"
        )
        two, one = (
            partial(side_by_side, job, count, sharded, seconds, is_read) for count in (2, 1)
        )
        cases.append(case.take_turns(turns, two=two, one=one))
    among = PILOTS + 1 if args.quick else BASES
    beats = Case(
        f"{PILOTS} pilots among {among} bases", "ms of processor time a second", "as among 10"
    )
    cases.append(
        beats.take_turns(
            turns,
            among_all=partial(piloted, among, seconds),
            among_10=partial(piloted, PILOTS, seconds),
            hearing_all=partial(piloted, among, seconds, True),
        )
    )
    publish("fleet", cases, args.json, fleets=fleets)
    return 0


if __name__ == "__main__":
    sys.exit(main())
