"""A fleet of planar robots that drive, as fast as the loop goes: 1 to 1000 of them, with odom at 20 Hz of sim time.

Another process commands each robot four times a second, a third one subscribes to `*/odom`. Beside it, in turns, the
bare engine steps the same bodies on the same ground. Time is processor time of all threads of the sim's process, so
the real-time factor is that of one core.
"""

import math
import re
import sys
import threading
import time
from contextlib import closing
from dataclasses import replace
from itertools import count

from benchmarks.company import beside, guest, host, meeting_point, until
from benchmarks.report import Case, parser, publish
from benchmarks.sim_loop import REST, ROBOT, WORLD, Stepper
from holozen.bus import Bus
from holozen.messages import Odometry, Twist
from holozen.robot.loading import load
from holozen.robot.model import RobotModel
from holozen.robot.rigid import lump
from services.sim.entities import Entities
from services.sim.loop import Loop
from services.sim.physics.engine import UPRIGHT
from services.sim.physics.world import World

AIM = "300 robots at 5 times real time on one core, 1000 at 1; a robot costs the same, 10 to 1000, within 1.5"
FLEETS = (1, 10, 100, 300, 1000)
GRID = 2.0  # m between two robots; each drives a circle of 0.4 m, all in step
COMMAND = Twist.planar(0.2, 0.0, 0.5)
COMMANDED = 4.0  # Hz of real time, of each robot
SETTLING = 120  # steps until all stand on the ground


def places(robots: int) -> list[tuple[float, float, float]]:
    """Where the robots start: a square grid."""
    side = math.ceil(math.sqrt(robots))
    return [(GRID * (i % side), GRID * (i // side), REST) for i in range(robots)]


def drive(endpoint: str, robots: int) -> None:
    """The pilot of them all."""
    with Bus("pilot", guest(endpoint)) as bus:
        commands = [bus.publisher(f"bot{i}/cmd_vel", Twist) for i in range(robots)]
        period = 1 / COMMANDED / robots
        start = time.monotonic()
        for number in count():
            commands[number % robots].put(COMMAND)
            time.sleep(max(0.0, start + number * period - time.monotonic()))


def watch(endpoint: str) -> None:
    """Who reads all odometry."""
    with Bus("watcher", guest(endpoint)) as bus:
        odoms = bus.subscribe_raw("*/odom")
        while True:
            odoms.recv()


def fleet(bus: Bus, world: World, model: RobotModel, robots: int) -> tuple[Entities, Stepper]:
    """Our loop with `robots` copies of a robot on their keys."""
    entities = Entities(bus, world, (5.0, 10.0))
    for number, at in enumerate(places(robots)):
        entities.add(f"bot{number}", model, (at, UPRIGHT))
    loop = Loop(bus, world, entities, rtf=0)
    return entities, lambda steps: loop.run(threading.Event(), steps)


def bare(model: RobotModel, robots: int) -> Stepper:
    """The same bodies and nothing but steps. Where the world is not quite level they keep their contacts."""
    world, body = World(replace(WORLD, gravity=(1e-9, 0.0, WORLD.gravity[2]))), lump(model)
    for at in places(robots):
        world.add(body, at)

    def step(steps: int) -> None:
        for _ in range(steps):
            world.step()

    return step


def timed(stepper: Stepper, steps: int, robots: int) -> list[float]:
    """Microseconds of processor time a robot and step."""
    start = time.process_time()
    stepper(steps)
    return [(time.process_time() - start) / steps / robots * 1e6]


def resident() -> int:
    """Bytes of memory that this process has."""
    with open("/proc/self/status") as status:
        return int(re.search(r"VmRSS:\s+(\d+)", status.read())[1]) * 1024  # type: ignore[index]


def measure(robots: int, turns: int, steps: int) -> tuple[Case, dict[str, float]]:
    """One fleet: its case, and the figures that have no other side."""
    model = load(ROBOT)
    assert model.drive is not None
    model = replace(model, drive=replace(model.drive, odometry_rate=20.0, command_timeout=-1.0))
    endpoint, before = meeting_point(), resident()
    with Bus("sim", host(endpoint)) as bus, closing(World(WORLD)) as world:
        start = time.process_time()
        entities, ours = fleet(bus, world, model, robots)
        spawning, memory = time.process_time() - start, resident() - before
        ours(SETTLING)
        with beside(drive, endpoint, robots), beside(watch, endpoint):
            odom = bus.subscribe(f"bot{robots - 1}/odom", Odometry)

            def driving() -> bool:
                ours(12)
                moved = [received.message for received in iter(odom.try_recv, None)]
                return any(message and message.twist.twist.linear.x > 0.1 for message in moved)

            until(driving, every=0)
            other = bare(model, robots)
            other(SETTLING)
            case = Case(f"{robots} robots", "us a robot and step", AIM).take_turns(
                turns, holozen=lambda: timed(ours, steps, robots), bare_engine=lambda: timed(other, steps, robots)
            )
            assert all(robot.arbiter.driver(time.monotonic()) for robot in entities.robots), "a robot was not commanded"
    cost = case.sides()["holozen"]["p50"]
    return case, {
        "robots": robots,
        "real_time_factor": 1e6 * WORLD.step / (cost * robots),
        "memory_KB_a_robot": memory / robots / 1000,
        "spawn_ms_a_robot": spawning / robots * 1000,
    }


def main() -> int:
    flags = parser("fleet", __doc__)
    flags.add_argument("--robots", type=int, nargs="+", default=FLEETS, metavar="N", help="how many (default: all)")
    args = flags.parse_args()
    cases, fleets = [], []
    for robots in args.robots:
        turns, steps = (1, 24) if args.quick else (9, max(48, 12 * (2000 // robots)))
        case, figures = measure(robots, turns, steps)
        cases.append(case)
        fleets.append(figures)
        print(", ".join(f"{name.replace('_', ' ')} {value:.4g}" for name, value in figures.items()), flush=True)
    publish("fleet", cases, args.json, fleets=fleets)
    return 0


if __name__ == "__main__":
    sys.exit(main())
