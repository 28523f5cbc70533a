"""Robots of parts with joints, in the real engine: against closed forms, and in whatever order a
file lists them.
"""

import itertools
import math

import pytest
from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.model import RobotModel
from services.sim.physics.jointed import JointedBody
from services.sim.physics.world import World
from tests.core.robots import robot

DT = 1 / 240
G = 9.8
HEAVY = 1e5  # kg and kg m^2: a base that what hangs on it does not move
CUBE = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def link(
    name: str, mass: float = 1.0, inertia: float = 1e-3, more: str = "", xyz: str = "0 0 0"
) -> str:
    moments = " ".join(f'{axis}="{inertia}"' for axis in ("ixx", "iyy", "izz"))
    return (
        f'<link name="{name}"><inertial><origin xyz="{xyz}"/><mass value="{mass}"/>'
        f'<inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>{more}</link>'
    )


def joint(
    name: str, parent: str, child: str, more: str = "", kind: str = "continuous", xyz: str = "0 0 0"
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}"/><parent link="{parent}"/><child '
        f'link="{child}"/>'
        f'<axis xyz="0 1 0"/>{more}</joint>'
    )


def limit(effort: float = 100, velocity: float = 100, lower: float = -1, upper: float = 1) -> str:
    return f'<limit effort="{effort}" velocity="{velocity}" lower="{lower}" upper="{upper}"/>'


def on_a_rock(more: str = "", kind: str = "continuous", inertia: float = 1e-3) -> RobotModel:
    """One link of 1 kg on the joint `j` of a base that nothing moves."""
    return robot(
        link("base", HEAVY, HEAVY), link("arm", 1, inertia), joint("j", "base", "arm", more, kind)
    )


def fixed(model: RobotModel) -> RobotModel:
    return replace(model, static=True)


def run(world: World, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        world.step()


def state(body: JointedBody, name: str = "j") -> tuple[float, float]:
    positions, rates, _ = body.states()
    return positions[body.names.index(name)], rates[body.names.index(name)]


def spun(world: World, body: JointedBody, rate: float) -> None:
    """A body whose joint turns at a rate, and is no longer driven."""
    body.turn("j", rate)
    run(world, 0.1)
    body.release("j")


def height(body: JointedBody) -> float:
    return body.pose()[0][2]


TREE = [("j1", "a", "b", 1.0), ("j2", "a", "c", 2.0), ("j3", "b", "d", 3.0), ("j4", "c", "e", 4.0)]


@pytest.mark.parametrize("order", list(itertools.permutations(range(4)))[::5])
def test_each_joint_turns_its_own_part_in_whatever_order_they_are_commanded(
    space: World, order: tuple[int, ...]
) -> None:
    links = [link("a", HEAVY, HEAVY), *(link(TREE[number][2]) for number in order)]
    joints = [joint(*TREE[number][:3]) for number in reversed(order)]
    body = space.add_jointed(robot(*links, *joints), (0, 0, 0))
    for name, _, _, rate in TREE:
        body.turn(name, rate)
    run(space, 0.5)
    for name, _, _, rate in TREE:
        angle, speed = state(body, name)
        assert speed == pytest.approx(rate, abs=1e-6)
        assert angle == pytest.approx(rate * 0.5, rel=0.02)


def test_a_torque_moves_the_part_of_its_joint_though_the_engine_numbers_them_otherwise(
    space: World,
) -> None:
    # Shapes that do not fit into a part are links of their own, which the engine counts between the
    # others.
    many = "".join(
        f'<collision><origin xyz="{i} 0 0"/>{CUBE.removeprefix("<collision>")}' for i in range(20)
    )
    inertias = {"jb": 1.0, "jc": 2.0, "jd": 4.0}
    wheels = [link(name[1], 1, inertia, many) for name, inertia in inertias.items()]
    joints = [
        joint(name, "a", name[1], xyz=f"0 {9 * number} 0") for number, name in enumerate(inertias)
    ]
    body = space.add_jointed(robot(link("a", HEAVY, HEAVY, many), *wheels, *joints), (0, 0, 0))
    for _ in range(24):
        for name in inertias:
            body.push(name, 10)
        space.step()
    for name, inertia in inertias.items():
        assert state(body, name)[1] == pytest.approx(10 / inertia * 0.1, rel=1e-2)


def test_more_shapes_than_the_engine_takes_for_one_part_all_touch(ground: World) -> None:
    # Twenty boxes in a row, of which only the last one is long enough to reach the ground.
    boxes = [
        f'<collision><origin xyz="{i} 0 0"/>{CUBE.removeprefix("<collision>")}'
        for i in range(-10, 10)
    ]
    leg = '<collision><origin xyz="0 0 -1"/><geometry><box size="20 1 0.1"/></geometry></collision>'
    body = ground.add_jointed(robot(link("a", 1, 1, "".join([*boxes, leg]))), (0, 0, 1.05))
    run(ground, 0.5)
    assert height(body) == pytest.approx(1.05, abs=1e-3)


def test_more_shapes_of_a_moved_part_touch_as_well(ground: World) -> None:
    boxes = [
        f'<collision><origin xyz="{i} 0 0"/>{CUBE.removeprefix("<collision>")}'
        for i in range(-10, 10)
    ]
    leg = (
        '<collision><origin xyz="0 0 -1"/><geometry><box size="20 20 0.1"/></geometry></collision>'
    )
    model = robot(
        link("a", 0.01),
        link("b", 1, 1, "".join([*boxes, leg])),
        joint("j", "a", "b", kind="revolute", more=limit(lower=0, upper=0)),
    )
    body = ground.add_jointed(model, (0, 0, 1.05))
    run(ground, 0.5)
    assert height(body) == pytest.approx(1.05, abs=5e-3)


def test_a_free_fall_is_one(air: World) -> None:
    model = robot(link("a"), link("b", 2, xyz="0.3 0 0"), joint("j", "a", "b", xyz="0.1 0 0"))
    body = air.add_jointed(model, (0, 0, 100))
    run(air, 1)
    # The engine's steps are semi-implicit: after n of them it has fallen g dt^2 n (n + 1) / 2.
    assert height(body) == pytest.approx(100 - G * (1 + DT) / 2, abs=1e-6)
    assert state(body) == pytest.approx((0, 0), abs=1e-9)


@pytest.mark.parametrize("friction", [0.001, 0.01])
def test_friction_in_a_joint_slows_it_down_evenly(space: World, friction: float) -> None:
    body = space.add_jointed(on_a_rock(f'<dynamics friction="{friction}"/>'), (0, 0, 0))
    spun(space, body, 10)
    run(space, 0.5)
    assert state(body)[1] == pytest.approx(10 - friction / 1e-3 * 0.5, rel=1e-3)


def test_friction_in_a_joint_brings_it_to_rest(space: World) -> None:
    body = space.add_jointed(on_a_rock('<dynamics friction="0.1"/>'), (0, 0, 0))
    spun(space, body, 10)
    run(space, 0.5)
    assert state(body)[1] == pytest.approx(0, abs=1e-9)


@pytest.mark.engines
def test_damping_slows_a_joint_down_exponentially(space: World) -> None:
    for damping, inertia in ((1e-3, 1e-3), (0.1, 1e-3), (0.5, 1e-3), (5, 1e-5)):
        for kind, more, inert in (
            ("continuous", "", inertia),
            ("prismatic", limit(1000, lower=-100, upper=100), 1),
        ):
            space.clear()
            body = space.add_jointed(
                on_a_rock(f'<dynamics damping="{damping}"/>{more}', kind, inertia), (0, 0, 0)
            )
            spun(space, body, 10)
            run(space, 0.25)
            assert state(body)[1] == pytest.approx(
                10 * math.exp(-damping / inert * 0.25), rel=1e-3, abs=1e-9
            )


def test_damping_that_is_too_strong_for_light_wheels_on_a_light_body_does_not_shake_them(
    space: World,
) -> None:
    names = ("b", "c", "d", "e")
    wheels = [link(name, 0.1, 1e-5) for name in names]
    joints = [joint(f"j{name}", "a", name, '<dynamics damping="5"/>') for name in names]
    body = space.add_jointed(robot(link("a", 0.1, 2e-5), *wheels, *joints), (0, 0, 0))
    body.put((0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0, 10, 0))
    run(space, 1)
    assert max(map(abs, body.states()[1])) < 1e-3


@pytest.mark.engines
def test_joints_keep_within_their_limits(space: World) -> None:
    for effort in (0.1, 5, 1000):
        space.clear()
        body = space.add_jointed(
            on_a_rock(limit(effort, lower=-0.5, upper=0.7), "revolute"), (0, 0, 0)
        )
        for rate, end in ((10, 0.7), (-10, -0.5)):
            for _ in range(240):
                body.turn("j", rate)
                space.step()
            assert state(body)[0] == pytest.approx(end, abs=1e-3)
        body.go("j", 3)
        run(space, 2)
        assert state(body)[0] == pytest.approx(0.7, abs=1e-3)


def test_a_joint_turns_no_faster_than_its_limit(space: World) -> None:
    body = space.add_jointed(on_a_rock('<limit effort="100" velocity="2"/>'), (0, 0, 0))
    body.turn("j", 50)
    run(space, 0.5)
    assert state(body)[1] == pytest.approx(2)


def test_a_push_turns_a_joint_no_faster_than_its_limit(space: World) -> None:
    body = space.add_jointed(on_a_rock('<limit effort="100" velocity="2"/>'), (0, 0, 0))
    for _ in range(240):
        body.push("j", 0.01)
        space.step()
    assert state(body)[1] == pytest.approx(2, abs=0.05)


def test_a_motor_gives_no_more_than_its_limit(space: World) -> None:
    body = space.add_jointed(on_a_rock('<limit effort="0.01" velocity="100"/>'), (0, 0, 0))
    body.turn("j", 50)
    run(space, 0.5)
    assert state(body)[1] == pytest.approx(0.01 / 1e-3 * 0.5, rel=1e-3)


def test_a_push_speeds_a_joint_up_by_newton(space: World) -> None:
    body = space.add_jointed(
        on_a_rock(limit(effort=5, lower=-100, upper=100), "prismatic"), (0, 0, 0)
    )
    for _ in range(120):
        body.push("j", 2.0)
        space.step()
    assert state(body)[1] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("effort", [1, 5, 100])
def test_a_slide_moves_to_its_commanded_position_and_stays(space: World, effort: float) -> None:
    body = space.add_jointed(on_a_rock(limit(effort=effort), "prismatic"), (0, 0, 0))
    body.go("j", 0.3)
    run(space, 4)
    assert state(body) == pytest.approx((0.3, 0), abs=3e-3)


@pytest.mark.engines
def test_a_joint_that_mimics_another_follows_it(space: World) -> None:
    more = '<mimic joint="j" multiplier="-2" offset="0.1"/>'
    links = (link("base", HEAVY, HEAVY), link("arm"), link("finger", 0.1, 1e-4))
    model = robot(*links, joint("j", "base", "arm"), joint("k", "base", "finger", more))
    body = space.add_jointed(model, (0, 0, 0))
    body.turn("j", 1)
    for _ in range(240):
        body.mimic()
        space.step()
    leader, follower = state(body)[0], state(body, "k")[0]
    assert leader == pytest.approx(1, abs=0.02)
    # it is a few hundredths of a second behind
    assert follower == pytest.approx(0.1 - 2 * leader, abs=0.06)


def pendulum_energy(body: JointedBody) -> float:
    """J of 1 kg at 0.5 m below the joint, with 1e-3 kg m^2 of its own."""
    angle, rate = state(body)
    return 0.5 * (1e-3 + 0.25) * rate**2 - G * 0.5 * math.cos(angle)


@pytest.mark.engines
def test_a_pendulum_keeps_its_energy_and_its_period(air: World) -> None:
    arm = link("arm", 1, 1e-3, xyz="0 0 -0.5")
    body = air.add_jointed(fixed(robot(link("base"), arm, joint("j", "base", "arm"))), (0, 0, 0))
    spun(air, body, 0.2)
    begin, crossings, last = pendulum_energy(body), [], state(body)[0]
    for step in range(10 * 240):
        air.step()
        angle = state(body)[0]
        if last < 0 <= angle:
            crossings.append(step * DT)
        last = angle
    swing = begin + G * 0.5  # above its rest
    assert abs(pendulum_energy(body) - begin) < 0.02 * swing
    period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert period == pytest.approx(math.tau * math.sqrt((1e-3 + 0.25) / (G * 0.5)), rel=5e-3)


@pytest.mark.engines
def test_a_body_that_tumbles_does_not_turn_ever_faster(space: World) -> None:
    moments = '<inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/>'
    base = f'<link name="a"><inertial><mass value="1"/>{moments}</inertial></link>'
    body = space.add_jointed(
        robot(base, link("b", 0.2, 3e-4), joint("j", "a", "b", xyz="0.1 0.1 0")), (0, 0, 0)
    )
    for spin in (5, 20, 50):
        # about the middle axis
        body.put((0, 0, 0), (0, 0, 0, 1), (0, 0, 0), (0.1 * spin, spin, 0.1 * spin))
        for _ in range(10 * 240):
            body.turn("j", 0)
            space.step()
            assert math.hypot(*body.twist()[1]) < 1.4 * spin


@pytest.mark.engines
def test_a_static_body_stays_where_it_is(air: World) -> None:
    body = air.add_jointed(fixed(robot(link("a", 1, 1, CUBE))), (1, 2, 3))
    run(air, 1)
    assert body.pose()[0] == (1, 2, 3)
    assert body.twist() == ((0, 0, 0), (0, 0, 0))


@pytest.mark.engines
def test_a_robot_rests_on_a_static_body(air: World) -> None:
    table = '<collision><geometry><box size="2 2 0.2"/></geometry></collision>'
    air.add_jointed(fixed(robot(link("t", 1, 1, table))), (0, 0, 0))
    body = air.add_jointed(robot(link("a", 1, 0.01, CUBE)), (0, 0, 0.15))
    run(air, 1)
    assert height(body) == pytest.approx(0.15, abs=1e-3)


@pytest.mark.parametrize(("kp", "kd"), [(1e4, 100), (1e6, 100), (1e7, 1), (1e12, 1)])
def test_a_body_that_falls_does_not_jump_whatever_its_stiffness(
    ground: World, kp: float, kd: float
) -> None:
    surface = f'<gazebo reference="a"><kp>{kp}</kp><kd>{kd}</kd></gazebo>'
    body = ground.add_jointed(robot(link("a", 1, 2e-3, CUBE), surface), (0, 0, 0.25))
    run(ground, 0.25)
    heights = [height(body)]
    for _ in range(480):
        ground.step()
        heights.append(height(body))
    assert max(heights) < 0.1
    assert heights[-1] == pytest.approx(0.05, abs=2e-3)


def test_the_root_and_its_centre_of_mass_may_be_apart(ground: World) -> None:
    low = (
        '<collision><origin xyz="0.2 0 -0.3"/><geometry><box size="0.4 0.4 '
        '0.1"/></geometry></collision>'
    )
    body = ground.add_jointed(robot(link("a", 1, 0.1, low, xyz="0.2 0 -0.3")), (1, 1, 0.35))
    run(ground, 1)
    assert body.pose()[0] == pytest.approx((1, 1, 0.35), abs=1e-3)


def test_too_many_joints_are_refused_with_their_number(space: World) -> None:
    many = [link(f"l{i}") + joint(f"j{i}", "base", f"l{i}") for i in range(130)]
    with pytest.raises(RobotError, match="130 moving joints; at most 119"):
        space.add_jointed(robot(link("base"), *many), (0, 0, 0))


def test_a_body_that_is_used_again_moves_as_a_new_one(ground: World) -> None:
    model = robot(
        link("a", 1, 0.1, CUBE), link("b", 1, 0.01, CUBE), joint("j", "a", "b", xyz="0.2 0 0")
    )

    def moves() -> list[object]:
        body = ground.add_jointed(model, (0.1, 0.2, 0.3), (0.0, 0.1, 0.0, math.sqrt(0.99)))
        body.turn("j", 5.0)
        states: list[object] = []
        for _ in range(240):
            ground.step()
            states.append((body.pose(), body.twist(), body.states()))
        body.remove()
        ground.step()
        return states

    first = moves()
    assert moves() == first


def test_what_touched_a_body_that_was_removed_falls(ground: World) -> None:
    table, cube = fixed(robot(link("a", 1, 1.7e-3, CUBE))), robot(link("a", 1, 1.7e-3, CUBE))
    for _ in range(2):
        below, above = (
            ground.add_jointed(table, (0, 0, 0.5)),
            ground.add_jointed(cube, (0, 0, 0.61)),
        )
        run(ground, 0.5)
        assert above.pose()[0][2] == pytest.approx(0.6, abs=1e-3)
        below.remove()
        run(ground, 1)
        assert above.pose()[0][2] == pytest.approx(0.05, abs=1e-3)
        above.remove()


def test_a_bounded_number_of_removed_bodies_is_kept(ground: World) -> None:
    pytest.importorskip("pybullet", reason="pybullet is not installed")
    from services.sim.physics.bullet import MAX_KEPT, Bullet, bullet

    model = robot(link("a", 1, 1.7e-3, CUBE))
    assert isinstance(ground.engine, Bullet)
    for body in [ground.add_jointed(model, (number, 0, 1)) for number in range(MAX_KEPT + 3)]:
        body.remove()
    assert bullet.getNumBodies(ground.engine.id) == 1 + MAX_KEPT
    body = ground.add_jointed(model, (0, 0, 1))
    assert bullet.getNumBodies(ground.engine.id) == 1 + MAX_KEPT
    run(ground, 1)
    assert body.pose()[0] == pytest.approx((0, 0, 0.05), abs=1e-3)
