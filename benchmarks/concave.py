"""What a house costs the engine that is one mesh, beside the same house made of boxes, while a
robot drives against its walls.

The mesh collides as it is, triangle by triangle; the boxes are what the engine is fastest at.
"""

import math
import sys
import tempfile
import time
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import trimesh

from benchmarks.report import Case, parser, publish
from holozen import data
from holozen.robot.files.loading import load
from holozen.robot.files.sdf_world import load_world
from holozen.robot.model import RobotModel
from services.sim.physics.movers import mover_for
from services.sim.physics.world import World

AIM = "known: the ratio is what the walls of one mesh cost"
ROBOT = data.find("urdf", "hb_bot.urdf.xacro")
WORLD = load_world(data.find("worlds", "gazebo.world"))
WALLS = (  # size and middle of each, in m: 4 m wide inside, with a door of 1.2 m
    ((4.4, 0.2, 0.8), (0.0, 2.1, 0.4)),
    ((4.4, 0.2, 0.8), (0.0, -2.1, 0.4)),
    ((0.2, 4.4, 0.8), (-2.1, 0.0, 0.4)),
    ((0.2, 1.6, 0.8), (2.1, 1.4, 0.4)),
    ((0.2, 1.6, 0.8), (2.1, -1.4, 0.4)),
)
SPEED, RATE = 1.2, 1.0  # m/s and rad/s: circles of 2.4 m, which a wall cuts short
REST = -0.04  # m; the height of the root frame when the robot stands on its wheels


def house(folder: Path, geometries: list[str]) -> RobotModel:
    """A house that does not move, of these collision shapes."""
    shapes = "".join(
        f"<collision name='c{number}'>{geometry}</collision>"
        for number, geometry in enumerate(geometries)
    )
    file = folder / "house.sdf"
    file.write_text(
        f"<sdf version='1.6'><model name='house'><static>true</static><link name='a'>{shapes}"
        "</link></model></sdf>"
    )
    return load(file)


def of_one_mesh(folder: Path) -> RobotModel:
    """The house as one mesh."""
    boxes: list[Any] = [trimesh.creation.box(size).apply_translation(at) for size, at in WALLS]
    whole: Any = trimesh.util.concatenate(boxes)
    whole.export(folder / "house.stl")
    return house(folder, ["<geometry><mesh><uri>house.stl</uri></mesh></geometry>"])


def of_boxes(folder: Path) -> RobotModel:
    """The house as boxes."""
    words = [(" ".join(map(str, at)), " ".join(map(str, size))) for size, at in WALLS]
    return house(
        folder,
        [f"<pose>{at} 0 0 0</pose><geometry><box><size>{size}</size></box></geometry>"
         for at, size in words],
    )  # fmt: skip


def drive(world: World, robot: Any, ticks: Any, steps: int) -> list[float]:
    """Microseconds a step, while the robot drives in circles that the walls cut short."""
    start = time.perf_counter()
    for _ in range(steps):
        heading = RATE * next(ticks) * WORLD.step
        robot.move((SPEED * math.cos(heading), SPEED * math.sin(heading), 0.0), WORLD.step)
        world.step()
    return [(time.perf_counter() - start) / steps * 1e6]


def main() -> int:
    args = parser("concave", __doc__).parse_args()
    turns, steps = (2, 300) if args.quick else (20, 4800)
    sides = {}
    with tempfile.TemporaryDirectory() as name:
        for side, made in (("one_mesh", of_one_mesh), ("boxes", of_boxes), ("no_house", None)):
            world = World(WORLD)
            if made:
                mover_for(world, made(Path(name)), (0.0, 0.0, 0.0))
            robot = mover_for(world, load(ROBOT), (0.0, 0.0, REST))
            sides[side] = partial(drive, world, robot, count(), steps)
        case = Case("driving in a house", "us/step", AIM).take_turns(turns, **sides)
    publish("concave", [case], args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
