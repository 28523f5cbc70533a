"""The sim's loop as fast as it goes, with commands and publishing, against a bare stepSimulation
loop.

The bare engine steps the same robot as it loads it: four links, three joints. Ours is one body
whose wheels turn only visually, so the engine alone with that body is measured too. --profile also
prints where our time goes.
"""

import sys
import threading
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

from benchmarks.company import PATIENCE, beside, guest, host, meeting_point
from benchmarks.report import Case, parser, publish
from holozen import data
from holozen.bus import Bus
from holozen.command import inputs
from holozen.messages import Twist
from holozen.robot.files.loading import load
from holozen.robot.files.sdf_world import load_world
from holozen.robot.files.xacro import expand_xacro
from holozen.robot.rigid import lump
from holozen.transport.pubsub import Publisher
from services.sim.entities import Entities
from services.sim.loop import Loop
from services.sim.physics.bullet import bullet
from services.sim.physics.world import World
from services.sim.robot import Robot
from services.sim.spawn import spawn_all
from services.sim.telemetry import Telemetry

AIM = "ratio <= 0.6 (ours / bare engine)"
ROBOT = data.find("urdf", "hb_bot.urdf.xacro")
WORLD = load_world(data.find("worlds", "gazebo.world"))
COMMAND = Twist.planar(0.3, 0.1, 0.4)
RATE = 20.0  # Hz of real time, of the commands
REST = -0.04  # m; the height of the root frame when the robot stands on its wheels

engine: Any = bullet  # imported there, where pybullet is kept from writing to the terminal

Stepper = Callable[[int], None]
"""Makes a number of steps."""


def repeated(step: Callable[[], object]) -> Stepper:
    """A Stepper that calls `step`."""

    def run(steps: int) -> None:
        for _ in range(steps):
            step()

    return run


PARTS = {
    "read: commands and requests": (Loop, "_read_inputs"),
    "move: read the body, set its velocity": (Robot, "move"),
    "step: the engine": (World, "step"),
    "publish: odom, tf, joint_states": (Telemetry, "publish"),
    "of which encode and send, with the clock": (Publisher, "put"),
}


def drive(endpoint: str) -> None:
    """A teleop with a key held down."""
    with Bus("pilot", guest(endpoint)) as bus:
        commands = bus.publisher("cmd_vel", Twist)
        while True:
            commands.put(COMMAND)
            time.sleep(1 / RATE)


def our_loop(bus: Bus) -> Stepper:
    """Our world with hb_bot on its keys, as `holozen sim --rtf 0` runs it."""
    world = World(WORLD)
    flags = Namespace(
        robot=None,
        package=[],
        allow_env=[],
        drive="",
        max_linear=inputs.MAX_LINEAR,
        max_angular=inputs.MAX_ANGULAR,
    )
    entities = Entities(bus, world, (flags.max_linear, flags.max_angular))
    spawn_all(entities, flags)
    loop = Loop(bus, world, entities, rtf=0)
    return lambda steps: loop.run(threading.Event(), steps)


def our_body() -> Stepper:
    """Our world and body, and nothing but steps."""
    world = World(WORLD)
    world.add(lump(load(ROBOT)), (0.0, 0.0, REST))
    return repeated(world.step)


def bare_loop() -> Stepper:
    """hb_bot's links and joints as the engine loads them, on a plane, and nothing but steps."""
    world = engine.connect(engine.DIRECT)
    engine.setGravity(*WORLD.gravity, physicsClientId=world)
    engine.setPhysicsEngineParameter(
        fixedTimeStep=WORLD.step, deterministicOverlappingPairs=1, physicsClientId=world
    )
    plane = engine.createCollisionShape(engine.GEOM_PLANE, physicsClientId=world)
    engine.createMultiBody(0, plane, physicsClientId=world)
    body = load_bare(world)
    for joint in range(engine.getNumJoints(body, physicsClientId=world)):
        engine.setJointMotorControl2(
            body, joint, engine.VELOCITY_CONTROL, force=0, physicsClientId=world
        )
    return repeated(partial(engine.stepSimulation, world))


def load_bare(world: int) -> int:
    """hb_bot without what the engine cannot load: meshes for the eye, and a root without mass,
    which it makes 1 kg.
    """
    robot = ElementTree.fromstring(expand_xacro(ROBOT))
    for part in robot.findall("link") + robot.findall("joint"):
        if part.get("name") in ("footprint_link", "footprint_joint"):
            robot.remove(part)
        for visual in part.findall("visual"):
            part.remove(visual)
    with TemporaryDirectory() as folder:
        file = Path(folder, "hb_bot.urdf")
        file.write_text(ElementTree.tostring(robot, encoding="unicode"))
        flags = engine.URDF_USE_INERTIA_FROM_FILE | engine.URDF_USE_IMPLICIT_CYLINDER
        return int(engine.loadURDF(str(file), [0, 0, REST], flags=flags, physicsClientId=world))


def timed(stepper: Stepper, steps: int) -> list[float]:
    """Microseconds a step."""
    start = time.perf_counter()
    stepper(steps)
    return [(time.perf_counter() - start) / steps * 1e6]


def profile(ours: Stepper, steps: int) -> dict[str, float]:
    """Microseconds of a step in each of PARTS, while a pilot commands. Measuring adds about 0.2 us
    to each call.
    """
    spent: Counter[str] = Counter()
    kept = {part: getattr(owner, name) for part, (owner, name) in PARTS.items()}
    for part, (owner, name) in PARTS.items():
        setattr(owner, name, _watched(kept[part], part, spent))
    [whole] = timed(ours, steps)
    for part, (owner, name) in PARTS.items():
        setattr(owner, name, kept[part])
    return {part: spent[part] / steps / 1000 for part in PARTS} | {"all of it": whole}


def _watched(call: Callable[..., Any], part: str, spent: Counter[str]) -> Callable[..., Any]:
    def watched(*args: Any) -> Any:
        start = time.perf_counter_ns()
        result = call(*args)
        spent[part] += time.perf_counter_ns() - start
        return result

    return watched


def compare(name: str, sides: tuple[Stepper, Stepper, Stepper], turns: int, steps: int) -> Case:
    """One case, `turns` rounds of `steps` a side."""
    ours, bare, body = sides
    return Case(name, "us/step", AIM).take_turns(
        turns,
        holozen=lambda: timed(ours, steps),
        bare_engine=lambda: timed(bare, steps),
        engine_with_our_body=lambda: timed(body, steps),
    )


def main() -> int:
    flags = parser("sim_loop", __doc__)
    flags.add_argument("--profile", action="store_true", help="also print where our time goes")
    args = flags.parse_args()
    turns, steps = (2, 300) if args.quick else (60, 2400)
    endpoint = meeting_point()
    with Bus("sim", host(endpoint)) as bus:
        sides = our_loop(bus), bare_loop(), our_body()
        compare("warm up", sides, 1, steps)
        cases = [compare("idle", sides, turns, steps)]
        with beside(drive, endpoint):
            pilot, deadline = bus.latest("cmd_vel", Twist), time.monotonic() + PATIENCE
            # it commands once it has heard the sim's beat, which the loop sends
            while not pilot.count:
                assert time.monotonic() < deadline, "the pilot did not come up"
                sides[0](1)
            cases.append(compare("driving", sides, turns, steps))
            shares = profile(sides[0], steps * 5) if args.profile else {}
    for part, share in shares.items():
        print(f"{share:7.2f} us/step  {part}")
    publish("sim_loop", cases, args.json, profile=shares)
    return 0


if __name__ == "__main__":
    sys.exit(main())
