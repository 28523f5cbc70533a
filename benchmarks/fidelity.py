"""Driven against commanded path: on omni wheels, as spheres or with real rollers, on mecanum and
other wheels, and as planar_move.

Each drive starts from rest, settles, and is commanded for some seconds, on a level floor and on a
ramp, with wheels of different friction. The commanded path is the closed form of the body-frame
velocity, in the plane of the ground: the straight line or the arc that wheels without slip would
drive.
"""

import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace

from benchmarks.report import parser, show, write
from holozen.flags import ENGINES
from holozen.kinematics import travelled
from holozen.limits import STOP, Planar
from holozen.plotting import Plane, Robot, draw
from holozen.robot.files.loading import load
from holozen.robot.model import Link, RobotModel, Shape, WorldSpec, driven
from holozen.robot.model import Pose as Place
from holozen.robot.rigid import lowest
from holozen.rotation import conjugate, from_rpy, multiply, rotate, yaw
from services.sim.physics.movers import mover_for
from services.sim.physics.world import World

URDF = Path(__file__).resolve().parents[1] / "urdf"
HB_BOT = load(URDF / "hb_bot.urdf.xacro")
ROBOTS = {
    "omni": driven(HB_BOT, "omni"),
    "omni_rollers": load(URDF / "omni.urdf.xacro"),
    "mecanum_rollers": load(URDF / "mecanum_rollers.urdf.xacro"),
    "differential": load(URDF / "differential.urdf.xacro"),
    "skid": load(URDF / "rover.urdf.xacro"),
    "planar_move": HB_BOT,
}
TWO_SIDED = ("differential", "skid")
# driven with each of FRICTIONS; the others as their file has it
SLIDES = ("omni", "omni_rollers", "mecanum_rollers")
MOTIONS: dict[str, Planar] = {
    "straight": (0.3, 0.0, 0.0),
    "strafe": (0.0, 0.3, 0.0),
    "diagonal": (0.2, 0.2, 0.0),
    "spin": (0.0, 0.0, 0.8),
    "arc": (0.3, 0.0, 0.5),
}
"""m/s and rad/s in the body frame; hb_bot's wheels turn by at most 5 rad/s, which is 0.7 m/s at
their rims.
"""
SLOPES = {"floor": 0.0, "ramp": 5.0}  # degrees, up along x
FRICTIONS = (0.2, 0.5, 1.0)  # of the wheels on the ground
SETTLES, SPEEDS_UP, LASTS = 0.5, 0.5, 4.0  # s


@dataclass(frozen=True)
class Result:
    """One drive. Once it has sped up, `error` is the distance between commanded and driven place at
    the end, in percent of the way, and `aside` the largest distance between them at any time;
    `heading` is the heading error at the end; `start` is the way that it lost while it sped up.
    """

    engine: str
    drive: str
    ground: str
    mu: float
    motion: str
    error: float  # %
    aside: float  # mm
    heading: float  # degrees
    start: float  # mm; of a spin degrees
    path: list[tuple[float, float]]
    commanded: list[tuple[float, float]]

    def row(self) -> tuple[str, ...]:
        mu = f"{self.mu:g}" if self.drive in SLIDES else "-"
        figures = (
            f"{self.error:.2f} %",
            f"{self.aside:.1f} mm",
            f"{self.heading:+.2f}",
            f"{self.start:.1f}",
        )
        return self.engine, self.drive, self.ground, mu, self.motion, *figures


HEAD = ("engine", "drive", "ground", "mu", "motion", "error", "aside", "heading", "start")


def with_friction(model: RobotModel, mu: float) -> RobotModel:
    """The model with this friction on its wheels and rollers."""
    links = {
        name: replace(link, surface=replace(link.surface, mu1=mu, mu2=mu))
        if "wheel" in name
        else link
        for name, link in model.links.items()
    }
    return replace(model, links=links)


def sloped(degrees: float) -> RobotModel:
    """A plane through the origin that goes up along x."""
    shape = Shape("plane", (100.0, 100.0), Place(rpy=(0.0, -math.radians(degrees), 0.0)))
    return RobotModel(
        "ramp", "ramp", {"ramp": Link("ramp", None, (), (shape,))}, {}, None, static=True
    )


def drive(engine: str, name: str, ground: str, mu: float, motion: str, seconds: float) -> Result:
    """One drive from rest."""
    tilt = from_rpy(0.0, -math.radians(SLOPES[ground]), 0.0)
    model = with_friction(ROBOTS[name], mu) if name in SLIDES else ROBOTS[name]
    with closing(World(WorldSpec(ground=ground == "floor"), engine)) as world:
        if ground != "floor":
            mover_for(world, sloped(SLOPES[ground]), (0.0, 0.0, 0.0))
        mover = mover_for(world, model, rotate(tilt, (0.0, 0.0, -lowest(model))), tilt)

        def place() -> Planar:
            position, rotation = mover.body.pose()
            x, y, _ = rotate(conjugate(tilt), position)
            return x, y, yaw(multiply(conjugate(tilt), rotation))

        def go(velocity: Planar, seconds: float) -> list[Planar]:
            places = [place()]
            for _ in range(round(seconds / world.spec.step)):
                mover.move(velocity, world.spec.step)
                world.step()
                places.append(place())
            return places

        velocity = MOTIONS[motion]
        begin = go(STOP, SETTLES)[-1]
        sped = go(velocity, SPEEDS_UP)[-1]
        places = go(velocity, seconds)
        times = [index * world.spec.step for index in range(len(places))]
    commanded = [ahead(sped, velocity, time) for time in times]
    gaps = [math.dist(a[:2], b[:2]) for a, b in zip(places, commanded, strict=True)]
    way = math.hypot(*velocity[:2]) * seconds
    heading = math.degrees(math.remainder(places[-1][2] - commanded[-1][2], math.tau))
    lost = ahead(begin, velocity, SPEEDS_UP)
    turned = math.degrees(math.remainder(sped[2] - lost[2], math.tau))
    start = 1000 * math.dist(sped[:2], lost[:2]) if way else abs(turned)
    error = (
        100 * gaps[-1] / way if way else 100 * abs(heading) / math.degrees(velocity[2] * seconds)
    )
    every = slice(None, None, 8)
    paths = [[(x, y) for x, y, _ in path[every]] for path in (places, commanded)]
    return Result(engine, name, ground, mu, motion, error, 1000 * max(gaps), heading, start, *paths)


def ahead(place: Planar, velocity: Planar, seconds: float) -> Planar:
    """Where a body is after moving at a constant body-frame velocity, without slip."""
    dx, dy = travelled(velocity, place[2], seconds)
    return place[0] + dx, place[1] + dy, place[2] + velocity[2] * seconds


def drives(engine: str, quick: bool) -> Iterator[Result]:
    """All of them in one engine; with the friction of a robot's file once."""
    for name in ROBOTS:
        for ground in SLOPES:
            for mu in FRICTIONS if name in SLIDES and not quick else FRICTIONS[-1:]:
                for motion, velocity in MOTIONS.items():
                    if name not in TWO_SIDED or not velocity[1]:
                        yield drive(engine, name, ground, mu, motion, 0.5 if quick else LASTS)


def plot(results: list[Result]) -> Iterator[str]:
    """The arcs as dots: driven by each side, and commanded."""
    arcs = [result for result in results if result.motion == "arc" and result.mu == FRICTIONS[-1]]
    for result in arcs:
        ways = {"driven": result.path, "commanded": result.commanded}
        robots = [Robot(way, *points[-1], 0.0, points) for way, points in ways.items()]
        yield f"{result.engine}: {result.drive} on the {result.ground}, arc, driven and commanded:"
        yield from draw(Plane(robots), (60, 14))


def main() -> None:
    made = parser("fidelity", (__doc__ or "").partition("\n")[0])
    made.add_argument(
        "--engine", choices=ENGINES, action="append", help="only this one; may be repeated"
    )
    args = made.parse_args()
    results = [result for engine in args.engine or ENGINES for result in drives(engine, args.quick)]
    show([HEAD, *(result.row() for result in results)])
    for line in plot(results):
        print(line)
    print(
        "aim: within 1 % of the way on its wheels, and within 0.1 % as planar_move, which is "
        "exact on the level"
    )
    write("fidelity", args.json, cases=[vars(result) for result in results])


if __name__ == "__main__":
    main()
