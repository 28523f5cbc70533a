"""The real engine, headless: robots stand on the ground, follow their closed-form arcs, and bump
into things.
"""

import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from holozen.limits import STOP, Planar
from holozen.messages import Quaternion
from holozen.robot.files.loading import load, parse
from holozen.robot.files.sdf_world import load_world
from holozen.robot.model import Pose, Shape, WorldSpec
from holozen.robot.rigid import Body, PlacedShape, lump
from holozen.rotation import from_rpy, rotate
from services.sim.physics.planar import PlanarBody
from services.sim.physics.world import World

REPO = Path(__file__).parents[3]
HB_BOT = lump(load(REPO / "urdf" / "hb_bot.urdf.xacro"))
DT = 1 / 240
GROUND = WorldSpec(ground=True)
Vector = tuple[float, float, float]
HALF = math.sqrt(0.5)


def shape(
    kind: str, size: tuple[float, ...], z: float, rotation: tuple[float, ...] = (0, 0, 0, 1)
) -> PlacedShape:
    x, y, s, c = rotation
    return PlacedShape("base", Shape(kind, size, Pose()), (0, 0, z), (x, y, s, c))


def body(
    *shapes: PlacedShape,
    centre: Vector = (0, 0, 0.1),
    tilt: float = 0.0,
    inertia: Vector = (0.1, 0.1, 0.1),
) -> Body:
    """A body of one kilogram, with its principal axes tilted about x by `tilt`."""
    return Body(1.0, centre, inertia, (math.sin(tilt / 2), 0, 0, math.cos(tilt / 2)), shapes)


BOX = shape("box", (1, 1, 0.4), 0.2)
OFF_CENTRE = body(BOX, centre=(0.2, -0.1, 0.1))
TILTED = body(BOX, centre=(0.1, 0.0, 0.1), tilt=0.8, inertia=(0.1, 0.15, 0.2))
BODIES = {"hb_bot": HB_BOT, "off-centre": OFF_CENTRE, "tilted principal axes": TILTED}


@pytest.fixture
def world(engine: str) -> Iterator[World]:
    with closing(World(GROUND, engine)) as world:
        yield world


def run(world: World, *driven: tuple[PlanarBody, Planar], seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        for base, velocity in driven:
            base.drive(velocity, DT)
        world.step()


def pose(base: PlanarBody) -> Vector:
    (x, y, _), rotation = base.pose()
    return x, y, Quaternion(*rotation).yaw()


def arc(velocity: Planar, seconds: float) -> tuple[float, float]:
    """Where a body that begins at the origin is after driving with `velocity` for a time."""
    x, y, turn = velocity
    if not turn:
        return x * seconds, y * seconds
    s, c = math.sin(turn * seconds), math.cos(turn * seconds)
    return (x * s + y * (c - 1)) / turn, (x * (1 - c) + y * s) / turn


@pytest.mark.engines
@pytest.mark.parametrize("name", BODIES)
def test_a_driven_robot_follows_its_closed_form_arc(world: World, name: str) -> None:
    within = 1e-4 if name == "hb_bot" else 2e-4  # a base that leans on one edge wobbles a little
    for velocity in ((0.5, 0, 0), (0, -0.5, 0), (0, 0, 2), (0.5, 0.3, 1), (-1, 0.5, -3)):
        world.clear()
        base = world.add(BODIES[name], (0, 0, 0))
        run(world, (base, STOP), seconds=2)  # until it has settled
        start_x, start_y, _ = pose(base)
        start = world.time
        for _ in range(10):
            run(world, (base, velocity), seconds=0.5)
            x, y, yaw = pose(base)
            turned = velocity[2] * (world.time - start)
            assert math.dist((x - start_x, y - start_y), arc(velocity, world.time - start)) < within
            assert math.remainder(yaw - turned, math.tau) == pytest.approx(0, abs=2e-4)


@pytest.mark.engines
@pytest.mark.parametrize("name", ["hb_bot", "off-centre"])
def test_the_measured_velocity_is_the_commanded_one_as_the_body_sees_it(
    world: World, name: str
) -> None:
    base = world.add(BODIES[name], (0, 0, 0))
    run(world, (base, STOP), seconds=2)
    velocity = (0.5, 0.3, 1.0)
    for _ in range(10):
        run(world, (base, velocity), seconds=0.4)
        assert base.velocity(DT) == pytest.approx(velocity, abs=1e-4)
        base.wake()  # from then on, the engine moves it
        run(world, (base, velocity), seconds=DT)
        assert base.velocity(DT) == pytest.approx(velocity, abs=1e-4)


@pytest.mark.engines
def test_hb_bot_settles_level_where_its_wheels_touch_the_ground(world: World) -> None:
    base = world.add(HB_BOT, (0, 0, 0))
    run(world, (base, STOP), seconds=2)
    (x, y, z), rotation = base.pose()
    assert (x, y) == pytest.approx((0, 0), abs=1e-5)
    assert z == pytest.approx(-0.04, abs=1e-4)
    assert rotation == pytest.approx((0, 0, 0, 1), abs=1e-5)


@pytest.mark.engines
def test_shapes_rest_on_the_ground_by_their_sizes(world: World) -> None:
    for part in (
        shape("box", (1, 0.8, 0.4), 0.2),
        shape("box", (0.4, 1, 0.8), 0.2, (0, HALF, 0, HALF)),
        shape("cylinder", (0.3, 0.2), 0.1),
        shape("cylinder", (0.14, 1.0), 0.14, (HALF, 0, 0, HALF)),
        shape("sphere", (0.1,), 0.1),
    ):
        world.clear()
        base = world.add(body(part), (1, 2, 0.3))
        run(world, (base, STOP), seconds=2)
        assert base.pose()[0] == pytest.approx((1, 2, 0), abs=1e-3), part


def test_a_shape_of_many_rests_on_the_lowest_and_a_mesh_is_left_out(world: World) -> None:
    low, mesh = shape("sphere", (0.2,), 0.0), shape("mesh", (1, 1, 1), -5)
    base = world.add(body(BOX, mesh, low), (0, 0, 0.5))
    run(world, (base, STOP), seconds=2)
    assert base.pose()[0][2] == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize("name", BODIES)
def test_a_robot_starts_upright_where_it_is_put(world: World, name: str) -> None:
    position, rotation = world.add(BODIES[name], (1, 2, 3)).pose()
    assert position == pytest.approx((1, 2, 3), abs=1e-6)
    assert rotation == pytest.approx((0, 0, 0, 1), abs=1e-6)


@pytest.mark.parametrize("name", ["hb_bot", "off-centre"])
def test_a_driven_robot_falls_as_anything_does(name: str) -> None:
    with closing(World(WorldSpec(gravity=(0, 0, -2), ground=False))) as world:
        base = world.add(BODIES[name], (0, 0, 0))
        run(world, (base, (0.5, 0, 1)), seconds=1)
        fallen = -2 * DT * DT * 240 * 241 / 2  # the sum over the steps
        assert base.pose()[0][2] == pytest.approx(fallen, abs=1e-3)


def test_a_robot_whose_centre_of_mass_is_beyond_its_base_tips_over(world: World) -> None:
    base = world.add(body(BOX, centre=(0.7, 0, 0.1)), (0, 0, 0))
    run(world, (base, STOP), seconds=1)
    x, y, *_ = base.pose()[1]
    assert 1 - 2 * (x * x + y * y) < 0.5  # its z axis has come down by more than 60 degrees


def test_a_robot_that_is_no_longer_driven_is_stopped_by_the_next_command(world: World) -> None:
    base = world.add(HB_BOT, (0, 0, 0))
    run(world, (base, (0.5, 0, 1)), seconds=1)
    run(world, (base, STOP), seconds=DT)
    assert base.velocity(DT) == pytest.approx(STOP, abs=1e-6)
    before = pose(base)
    run(world, (base, STOP), seconds=1)
    assert pose(base) == pytest.approx(before, abs=1e-6)


@pytest.mark.engines
@pytest.mark.parametrize("name", ["hb_bot", "off-centre"])
def test_a_stopped_robot_holds_its_place_on_a_slope(name: str, engine: str) -> None:
    steep = 0.25  # rad
    gravity = (9.8 * math.sin(steep), 0, -9.8 * math.cos(steep))  # as seen from the slope
    with closing(World(WorldSpec(gravity=gravity, ground=True), engine)) as world:
        base = world.add(BODIES[name], (0, 0, 0))
        run(world, (base, STOP), seconds=2)
        run(world, (base, (-0.5, 0, 0)), seconds=1)
        run(world, (base, STOP), seconds=1)
        start = pose(base)
        run(world, (base, STOP), seconds=10)
        assert pose(base) == pytest.approx(start, abs=1e-4)
        assert base.velocity(DT) == pytest.approx(STOP, abs=1e-4)


@pytest.mark.engines
def test_a_robot_pushes_what_is_not_driven(world: World) -> None:
    pusher, pushed = world.add(HB_BOT, (0, 0, 0)), world.add(HB_BOT, (1.7, 0, 0))
    run(world, (pusher, (0.5, 0, 0)), seconds=2)
    assert pose(pushed)[0] > 1.75
    assert pose(pushed)[0] - pose(pusher)[0] > 1.0


def test_two_worlds_know_nothing_of_each_other(world: World) -> None:
    with closing(World(GROUND)) as other:
        here, there = world.add(HB_BOT, (0, 0, 0)), other.add(HB_BOT, (0, 0, 0))
        run(world, (here, (0.5, 0, 0)), seconds=1)
        assert pose(here)[0] == pytest.approx(0.5, abs=1e-4)
        assert there.pose()[0] == pytest.approx((0, 0, 0), abs=1e-6)


@pytest.mark.engines
def test_the_same_commands_end_in_the_same_bits(engine: str) -> None:
    ends = []
    for _ in range(2):
        with closing(World(GROUND, engine)) as world:
            base = world.add(HB_BOT, (0, 0, 0))
            run(world, (base, (0.5, 0.3, 1)), seconds=2)
            ends.append((base.pose(), base.velocity(DT)))
    assert ends[0] == ends[1]


def test_time_is_counted_in_steps(world: World) -> None:
    for _ in range(1000):
        world.step()
    assert (world.steps, world.time) == (1000, 1000 * world.spec.step)


def test_the_step_of_the_world_is_the_engines() -> None:
    with closing(World(WorldSpec(step=0.01, ground=False, gravity=(0, 0, 0)))) as world:
        base = world.add(HB_BOT, (0, 0, 0))
        for _ in range(10):
            base.drive((1, 0, 0), 0.01)
            world.step()
        assert pose(base)[0] == pytest.approx(0.1, abs=1e-6)


def test_loading_the_engine_prints_nothing_and_leaves_standard_error_open() -> None:
    words = [
        sys.executable,
        "-c",
        "import services.sim.physics.world, sys; print('still here', file=sys.stderr)",
    ]
    done = subprocess.run(words, capture_output=True, text=True, cwd=REPO, timeout=60)
    assert (done.stdout, done.stderr) == ("", "still here\n")


CAMERA = (
    '<robot name="camera"><link name="c"><inertial><mass value="0.1"/><inertia ixx="1e-3" '
    'iyy="1e-3" izz="1e-3"/>'
    '</inertial><collision><geometry><box size="0.1 0.1 '
    '0.1"/></geometry></collision></link>{}</robot>'
)
OFF = '<gazebo reference="c"><{0}>{1}</{0}></gazebo>'
SDF_CAMERA = (
    '<sdf version="1.6"><model name="camera"><link '
    'name="c"><gravity>{}</gravity><inertial><mass>0.1</mass></inertial>'
    '<collision name="c"><geometry><box><size>0.1 0.1 '
    "0.1</size></box></geometry></collision></link></model></sdf>"
)


def fallen(world: World, text: str, *joints: str) -> float:
    """Metres by which a robot sinks in a second from 18 m."""
    body = world.add_jointed(parse(text, Path("camera.urdf")), (0, 0, 18))
    for _ in range(240):
        world.step()
    (x, y, z), _ = body.pose()
    assert abs(x) + abs(y) < 1e-6
    body.remove()
    world.step()
    return 18 - z


@pytest.mark.engines
def test_a_link_without_gravity_floats(world: World) -> None:
    for text in (
        OFF.format("gravity", "false"),
        OFF.format("gravity", "0"),
        OFF.format("turnGravityOff", "true"),
    ):
        assert fallen(world, CAMERA.format(text)) == pytest.approx(0, abs=1e-6), text
    for word in ("0", "false"):
        assert fallen(world, SDF_CAMERA.format(word)) == pytest.approx(0, abs=1e-6), word
    assert fallen(world, SDF_CAMERA.format("true")) == pytest.approx(4.9, abs=0.05)
    assert fallen(world, CAMERA.format(OFF.format("gravity", "true"))) == pytest.approx(
        4.9, abs=0.05
    )


@pytest.mark.engines
def test_gravity_pulls_the_links_of_a_body_that_have_it(world: World) -> None:
    part = (
        CAMERA.split("<link", 1)[1]
        .split("{}")[0]
        .replace('"c"', '"d"')
        .replace('"0.1"', '"0.3"', 1)
    )
    ends = '<parent link="c"/><child link="d"/><origin xyz="0 0 -0.1"/><axis xyz="0 0 1"/>'
    joint = f'<joint name="j" type="{{}}">{ends}</joint>'
    off = OFF.format("gravity", "0")
    assert fallen(
        world, CAMERA.format(f"<link{part}{joint.format('fixed')}{off}")
    ) == pytest.approx(4.9 * 3 / 4, abs=0.05)
    both = off + off.replace('"c"', '"d"')
    assert fallen(
        world, CAMERA.format(f"<link{part}{joint.format('continuous')}{both}")
    ) == pytest.approx(0, abs=1e-6)


def test_a_driven_robot_without_gravity_stays_at_its_height(world: World) -> None:
    base = world.add(
        lump(parse(CAMERA.format(OFF.format("gravity", "0")), Path("camera.urdf"))), (0, 0, 1)
    )
    run(world, (base, (0.5, 0, 0)), seconds=1)
    assert base.pose()[0] == pytest.approx((0.5, 0, 1), abs=1e-3)


BUMP = (
    '<sdf version="1.7"><model name="bump"><static>true</static><link name="l"><collision '
    'name="c"><geometry><box>'
    "<size>0.2 {} {}</size></box></geometry></collision></link></model></sdf>"
)
TALL_BOX = body(
    shape("box", (0.2, 0.2, 0.6), 0.3), centre=(0, 0, 0.3), inertia=(0.033, 0.033, 0.0067)
)
UPRIGHT_BOX = body(shape("box", (0.3, 0.3, 0.2), 0.1), inertia=(0.01, 0.01, 0.01))


def tilt(base: PlanarBody) -> float:
    """Degrees by which the robot's z axis is off the vertical."""
    return math.degrees(math.acos(min(1.0, rotate(base.pose()[1], (0, 0, 1))[2])))


def steepest(world: World, base: PlanarBody, velocity: Planar, seconds: float) -> float:
    """The largest tilt while the robot drives."""
    most = 0.0
    for _ in range(round(seconds / DT)):
        base.drive(velocity, DT)
        world.step()
        most = max(most, tilt(base))
    return most


def test_a_robot_that_meets_a_low_edge_climbs_it_or_stands(world: World) -> None:
    for robot in (HB_BOT, UPRIGHT_BOX, TALL_BOX):
        for width, height in ((0.1, 0.02), (3, 0.02)):
            for heading in (0.0, 0.4, math.pi / 3):
                start = -2.0 if robot is HB_BOT else -1.5
                base = world.add(
                    robot, (start, 0, -0.04 * (robot is HB_BOT)), from_rpy(0, 0, heading)
                )
                run(world, (base, STOP), seconds=0.5)
                bump = world.add_jointed(
                    parse(BUMP.format(width, height), Path("b")), (0, 0, height / 2)
                )
                ahead = (0.5 * math.cos(heading), -0.5 * math.sin(heading), 0)
                assert steepest(world, base, ahead, 5) < 20, (width, height, heading)
                bump.remove()
                run(world, (base, STOP), seconds=0.5)
                assert tilt(base) < 1
                # with nothing in its way it comes up to its speed
                run(world, (base, ahead), seconds=1)
                before = pose(base)
                run(world, (base, ahead), seconds=1)
                assert math.dist(before[:2], pose(base)[:2]) == pytest.approx(0.5, abs=5e-3)
                base.remove()


@pytest.mark.engines
def test_a_robot_that_meets_the_side_of_the_ramp_stays_upright(engine: str) -> None:
    spec = load_world(REPO / "worlds" / "arena.world")
    for y in (0.5, 1.3):
        with closing(World(spec, engine)) as world:
            for model in spec.models:
                world.add_jointed(model, model.pose.xyz, from_rpy(*model.pose.rpy))
            base = world.add(HB_BOT, (1.2, y, -0.04))
            run(world, (base, STOP), seconds=0.5)
            assert steepest(world, base, (0.5, 0, 0), 3) < 20, y


def obstacle(world: World, size: str, at: Vector) -> None:
    text = f'<collision><geometry><box size="{size}"/></geometry></collision>'
    text = (
        '<robot name="b"><link '
        f'name="b">{text}</link><gazebo><static>true</static></gazebo></robot>'
    )
    world.add_jointed(parse(text, Path("b.urdf")), at)


@pytest.mark.engines
@pytest.mark.parametrize("speed", [2.0, 5.0])
def test_a_thin_wall_stops_a_robot_at_any_speed(world: World, speed: float) -> None:
    obstacle(world, "0.02 6 0.5", (2, 0, 0.25))
    robot = world.add(HB_BOT, (0, 0, 0))
    run(world, (robot, (speed, 0, 0)), seconds=3)
    (x, _, z), rotation = robot.pose()
    assert 1.2 < x < 1.35, "its right wheel is at the wall"
    assert z == pytest.approx(-0.04, abs=0.005) and rotate(rotation, (0, 0, 1))[2] > 0.999


@pytest.mark.engines
def test_a_robot_that_drives_over_an_edge_falls_and_drives_on(world: World) -> None:
    obstacle(world, "3 3 0.3", (0, 0, 0.15))
    robot = world.add(HB_BOT, (0, 0, 0.3))
    run(world, (robot, (0.5, 0, 0)), seconds=1)
    assert robot.pose()[0][2] == pytest.approx(0.26, abs=0.005), "it stands on top"
    run(world, (robot, (0.5, 0, 0)), seconds=5)
    assert robot.pose()[0][2] < 0.1 and robot.pose()[0][0] > 1.5


@pytest.mark.engines
@pytest.mark.parametrize(
    "velocity", [(0, 0, 0.8), (0, 0.3, 0), (0, 0, 0)], ids=["spin", "strafe", "stop"]
)
def test_a_slope_moves_no_robot_that_drives_or_stands_on_it(velocity: Planar, engine: str) -> None:
    slope = math.radians(5)
    normal, tilt = (-math.sin(slope), 0.0, math.cos(slope)), from_rpy(0, -slope, 0)
    plane = "<collision><geometry><plane><normal>{} {} {}</normal></plane></geometry></collision>".format(  # noqa: E501
        *normal
    )
    spec = WorldSpec(ground=False)
    with closing(World(spec, engine)) as world:
        text = (
            "<sdf version='1.6'><model name='m'><static>true</static><link "
            f"name='l'>{plane}</link></model></sdf>"
        )
        world.add_jointed(parse(text, Path("m.sdf")), (0, 0, 0))
        robot = world.add(HB_BOT, rotate(tilt, (0, 0, -0.04)), tilt)
        run(world, (robot, STOP), seconds=1)
        (x, y, z), _ = robot.pose()
        for _ in range(20):
            run(world, (robot, velocity), seconds=0.1)
            x, y = (x, y) if velocity[2] else (x + velocity[0] * 0.1, y + velocity[1] * 0.1)
            assert robot.pose()[0] == pytest.approx(
                (x, y, z), abs=1e-4 if velocity == STOP else 1e-3
            )
            assert rotate(robot.pose()[1], (0, 0, 1)) == pytest.approx(normal, abs=1e-4), (
                "it stays flat"
            )
        assert robot.velocity(DT) == pytest.approx(velocity, abs=5e-3)
