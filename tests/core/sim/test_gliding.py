"""A planar robot on level ground with nothing near moves in closed form; where something is near,
contacts are back.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace

from holozen.limits import STOP, Planar
from holozen.robot.files.loading import load, parse
from holozen.robot.files.sdf_world import load_world
from holozen.robot.model import WorldSpec
from holozen.robot.rigid import lump
from holozen.rotation import from_rpy
from services.sim.physics.body import Body
from services.sim.physics.engine import UPRIGHT
from services.sim.physics.planar import LONGEST_PERIOD, PlanarBody
from services.sim.physics.world import World

REPO = Path(__file__).parents[3]
HB_BOT = lump(load(REPO / "urdf" / "hb_bot.urdf.xacro"))
REST = -0.04  # m; its height when it stands on its wheels
DT = 1 / 240
CRATE = (
    '<sdf version="1.7"><model name="crate"><static>{}</static><link '
    'name="l"><inertial><mass>0.2</mass></inertial>'
    "<collision "
    'name="c"><geometry><box><size>{}</size></box></geometry></collision></link></model></sdf>'
)
FLAT = WorldSpec(ground=True)
ARENA = load_world(REPO / "worlds" / "arena.world")
Route = list[tuple[Planar, float]]
"""Velocities, and how long to drive at each in s."""


def put(world: World, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> PlanarBody:
    return world.add(HB_BOT, (x, y, REST), from_rpy(0, 0, heading))


def crate(world: World, size: str, *at: float, static: bool = True) -> Body:
    x, y, z = at
    return world.add_jointed(
        parse(CRATE.format(str(static).lower(), size), Path("crate.sdf")), (x, y, z)
    )


def run(world: World, seconds: float, *driven: tuple[PlanarBody, Planar]) -> Iterator[None]:
    """Drive on, and check each step: in none does a robot jump."""
    for _ in range(round(seconds / DT)):
        before = [(base.pose()[0], math.hypot(*base.twist()[0])) for base, _ in driven]
        for base, velocity in driven:
            base.drive(velocity, DT)
        world.step()
        for (base, velocity), (place, speed) in zip(driven, before, strict=True):
            assert math.dist(place, base.pose()[0]) < (max(math.hypot(*velocity), speed) + 0.1) * DT
        yield


def settle(world: World, *bases: PlanarBody) -> None:
    for _ in run(world, 0.5, *((base, STOP) for base in bases)):
        pass


def settled(world: World, *at: float) -> PlanarBody:
    """A robot that has settled there, and glides."""
    base = put(world, *at)
    settle(world, base)
    assert base.glides
    return base


def walls(world: World) -> list[Body]:
    return [crate(world, "0.2 8 1", 4, 0, 0.5)]


def edge(world: World) -> list[Body]:
    return [crate(world, "3 3 0.01", 3, 0, 0.005)]


def pushed_robot(world: World) -> list[Body]:
    return [put(world, 3.0)]


def pushed_crate(world: World) -> list[Body]:
    return [crate(world, "0.3 0.3 0.3", 1.5, 0, 0.15, static=False)]


def arena(world: World) -> list[Body]:
    return [
        world.add_jointed(model, model.pose.xyz, from_rpy(*model.pose.rpy))
        for model in ARENA.models
    ]


WAYS: dict[
    str, tuple[Callable[[World], list[Body]], WorldSpec, tuple[float, float, float], Route]
] = {
    "nothing": (
        lambda _: [],
        FLAT,
        (0, 0, 0),
        [((0.5, 0, 0), 1), ((0.3, -0.2, 1), 1), ((0, 0, -3), 0.5), ((2, 0.5, 2), 1), (STOP, 0.5)],
    ),
    "a wall at 2 m/s": (walls, FLAT, (0, 0, 0), [((2, 0, 0), 2.5), (STOP, 0.5), ((-0.5, 0, 0), 1)]),
    "a robot that stands": (pushed_robot, FLAT, (0, 0, 0), [((0.5, 0, 0), 5), (STOP, 0.5)]),
    "a crate": (pushed_crate, FLAT, (0, 0, 0), [((0.5, 0, 0), 4), ((-0.5, 0, 0), 1)]),
    "a low edge": (edge, FLAT, (0, 0, 0), [((0.5, 0, 0), 5)]),
    "a ramp": (
        arena,
        ARENA,
        (3.75, 2.7, -math.pi / 2),
        [((0.5, 0, 0), 5), (STOP, 1), ((-0.5, 0, 0), 5)],
    ),
}


@pytest.mark.parametrize("name", WAYS)
def test_it_takes_the_same_way_as_with_contacts_throughout(name: str) -> None:
    """In a world that is not quite level, nothing glides."""
    things, spec, start, route = WAYS[name]
    within = 1e-3  # m
    tilted = replace(spec, gravity=(1e-9, 0.0, spec.gravity[2]))
    with closing(World(spec)) as level, closing(World(tilted)) as other:
        mine, theirs = put(level, *start), put(other, *start)
        settle(level, mine)
        settle(other, theirs)
        pairs = [(mine, theirs), *zip(things(level), things(other), strict=True)]
        glided = mine.glides
        for velocity, seconds in route:
            both = zip(
                run(level, seconds, (mine, velocity)),
                run(other, seconds, (theirs, velocity)),
                strict=True,
            )
            for _ in both:
                glided = glided or mine.glides
                assert not theirs.glides
                for one, same in pairs:
                    assert math.dist(one.pose()[0], same.pose()[0]) < within, (velocity, level.time)
                    turned = sum(a * b for a, b in zip(one.pose()[1], same.pose()[1], strict=True))
                    assert abs(turned) > 1 - within**2, (velocity, level.time)
        assert glided


def test_it_keeps_its_motion_without_a_new_command(ground: World) -> None:
    base = settled(ground)
    base.drive((0.5, 0, 0), DT)
    for _ in range(240):
        ground.step()
    assert base.pose()[0] == pytest.approx((0.5, 0, REST), abs=1e-4)
    linear, angular = base.twist()
    assert linear == pytest.approx((0.5, 0, 0), abs=1e-6) and angular == pytest.approx(
        (0, 0, 0), abs=1e-9
    )


def test_one_that_stands_is_pushed_by_one_that_comes_fast(ground: World) -> None:
    standing, coming = settled(ground), settled(ground, 4.0, 0.0, math.pi)
    for _ in range(240):
        coming.drive((5, 0, 0), DT)
        standing.drive(STOP, DT)
        ground.step()
        assert math.dist(standing.pose()[0], coming.pose()[0]) > 1.1
    assert standing.pose()[0][0] < -0.01


def test_two_that_start_towards_each_other_between_two_looks_meet(ground: World) -> None:
    """How fast others may be is known from a third one, which drives all the time."""
    third, one, other = settled(ground, 0.0, 9.0), settled(ground), settled(ground, 2.4)
    for later in range(0, LONGEST_PERIOD, 5):
        for base, x in ((one, 0.0), (other, 2.4)):
            base.put((x, 0, REST), UPRIGHT, (0, 0, 0), (0, 0, 0))
        speeds = {third: (0.0, 0.0, 2.0), one: STOP, other: STOP}
        for step in range(240 + later):
            speeds |= {one: (2.0, 0.0, 0.0)} if step >= 120 else {}
            speeds |= {other: (-2.0, 0.0, 0.0)} if step >= 120 + later else {}
            for base, velocity in speeds.items():
                base.drive(velocity, DT)
            ground.step()
            assert math.dist(one.pose()[0], other.pose()[0]) > 1.3, later


def test_what_falls_on_it_lies_on_it(ground: World) -> None:
    base, box = settled(ground), crate(ground, "0.2 0.2 0.1", 0, 0, 3, static=False)
    for _ in run(ground, 2, (base, STOP)):
        pass
    assert box.pose()[0][2] > 0.2
    assert not base.glides


def test_it_falls_where_it_is_put_and_glides_again_once_it_stands(ground: World) -> None:
    base = settled(ground)
    base.put((3, 1, 0.5), (0, 0, 0, 1), (0, 0, 0), (0, 0, 0))
    assert not base.glides
    ground.step()
    assert base.pose()[0][2] < 0.5
    for _ in range(480):
        base.drive(STOP, DT)
        ground.step()
    assert base.glides
    assert base.pose()[0] == pytest.approx((3, 1, REST), abs=1e-3)


def test_it_stops_gliding_where_something_is_put_beside_it_until_that_has_left(
    ground: World,
) -> None:
    base = settled(ground)
    crate(ground, "0.2 2 1", 0.83, 0, 0.5)
    settle(ground, base)
    assert not base.glides
    for _ in run(ground, 2, (base, (-0.5, 0, 0))):
        pass
    assert base.glides


def test_a_wall_that_is_put_in_its_way_stops_it_wherever_it_is_between_two_looks(
    ground: World,
) -> None:
    base, wall = put(ground), crate(ground, "0.2 4 1", 1.5, 0, 0.5)
    for _ in run(ground, 3, (base, (0.5, 0, 0))):
        pass
    reach, away = 1.5 - base.pose()[0][0], ((20.0, 0.0, 0.5), UPRIGHT)
    for phase in range(0, LONGEST_PERIOD, 5):
        ground.put(wall, away, (0, 0, 0), (0, 0, 0))
        base.put((0, 0, REST), UPRIGHT, (0, 0, 0), (0, 0, 0))
        for _ in run(ground, 1 + phase * DT, (base, (0.5, 0, 0))):
            pass
        assert base.glides
        (x, y, _), _ = base.pose()
        ground.put(wall, ((x + reach + 0.05, y, 0.5), UPRIGHT), (0, 0, 0), (0, 0, 0))
        for _ in run(ground, 0.5, (base, (0.5, 0, 0))):
            assert base.pose()[0][0] < x + 0.055, phase


def test_nothing_glides_where_there_is_no_ground(air: World) -> None:
    base = air.add(HB_BOT, (0, 0, 0))
    for _ in range(240):
        base.drive(STOP, DT)
        air.step()
    assert not base.glides and base.pose()[0][2] < -4


def test_a_robot_that_is_removed_while_it_glides_is_gone(ground: World) -> None:
    base, other = settled(ground), settled(ground, 3.0)
    base.remove()
    for _ in run(ground, 6, (other, (-0.5, 0, 0))):
        assert other.glides
    assert other.pose()[0][0] == pytest.approx(0, abs=1e-3)


def test_a_robot_looks_again_after_a_step_that_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(World(FLAT)) as world, monkeypatch.context() as patch:
        base = put(world)

        def look(_body: PlanarBody) -> None:
            raise ValueError

        patch.setattr(PlanarBody, "check_neighbours", look)
        with pytest.raises(ValueError):
            for _ in range(LONGEST_PERIOD + 1):
                world.step()
        assert base.check_at > world.steps
