"""A robot in parts: what fixed joints hold together is one, and every part knows what carries
it.
"""

import math

import pytest

from holozen.robot.model import Inertial, Joint, Limits, Link, Pose, RobotModel, Shape, Surface
from holozen.robot.rigid import Part, assemble, lump

UNIT = (0.01, 0.0, 0.0, 0.01, 0.0, 0.01)
BOX = Shape("box", (0.1, 0.1, 0.1), Pose())
Vector = tuple[float, float, float]


def link(
    name: str, mass: float = 1.0, surface: Surface | None = None, touches: bool = True
) -> Link:
    inertial = Inertial(Pose(), mass, UNIT) if mass else None
    return Link(name, inertial, (), (BOX,) if touches else (), surface or Surface())


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "continuous",
    xyz: Vector = (0, 0, 0),
    yaw: float = 0,
) -> Joint:
    return Joint(name, kind, parent, child, Pose(xyz, (0, 0, yaw)), (0.0, 1.0, 0.0), Limits())


def robot(links: list[Link], joints: list[Joint], root: str = "base") -> RobotModel:
    return RobotModel("r", root, {x.name: x for x in links}, {x.name: x for x in joints}, None)


def by_link(parts: list[Part]) -> dict[str, Part]:
    return {part.link: part for part in parts}


def test_a_single_link_is_one_part() -> None:
    (part,) = assemble(robot([link("base", 2)], []))
    assert (part.link, part.joint, part.parent, part.body.mass) == ("base", None, None, 2)


def test_a_fixed_joint_makes_no_part() -> None:
    parts = assemble(
        robot([link("base"), link("top", 3)], [joint("j", "base", "top", "fixed", (0, 0, 1))])
    )
    assert [part.link for part in parts] == ["base"]
    assert parts[0].body.mass == 4
    assert parts[0].body.centre == pytest.approx((0, 0, 0.75))
    assert len(parts[0].body.collisions) == 2


@pytest.mark.parametrize("kind", ["continuous", "revolute", "prismatic"])
def test_a_moving_joint_makes_a_part_where_the_joint_is(kind: str) -> None:
    parts = assemble(
        robot(
            [link("base"), link("arm", 3)],
            [joint("j", "base", "arm", kind, (1, 2, 3), math.pi / 2)],
        )
    )
    arm = by_link(parts)["arm"]
    assert arm.joint is not None
    assert (arm.joint.name, arm.parent, arm.xyz, arm.body.mass) == ("j", 0, (1, 2, 3), 3)
    assert arm.rotation == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))


def test_a_part_hangs_on_the_part_that_fixed_joints_make() -> None:
    links = [link("base"), link("mast"), link("arm"), link("hand"), link("finger")]
    joints = [
        joint("j4", "hand", "finger", "continuous", (0, 0, 5)),
        joint("j3", "arm", "hand", "fixed", (0, 0, 1)),
        joint("j2", "mast", "arm", "continuous", (1, 0, 0)),
        joint("j1", "base", "mast", "fixed", (0, 0, 2), math.pi / 2),
    ]
    parts = assemble(robot(links, joints))
    found = by_link(parts)
    assert [part.link for part in parts] == ["base", "arm", "finger"]
    assert found["arm"].xyz == pytest.approx((0, 1, 2))
    assert found["finger"].parent == parts.index(found["arm"])
    assert found["finger"].xyz == pytest.approx((0, 0, 6))
    assert found["arm"].body.mass == 2


def test_parents_come_before_their_children_whatever_the_file_s_order() -> None:
    names = ["e", "c", "d", "b", "base"]
    pairs = [("d", "e"), ("c", "d"), ("b", "c"), ("base", "b")]
    joints = [joint(f"j{child}", parent, child) for parent, child in pairs]
    parts = assemble(robot([link(name) for name in names], joints))
    assert [part.parent for part in parts] == [None, 0, 1, 2, 3]


@pytest.mark.parametrize("mass", [0.0, 1e-9])
def test_a_joint_that_moves_no_mass_is_taken_as_fixed(mass: float) -> None:
    parts = assemble(robot([link("base"), link("ghost", mass)], [joint("j", "base", "ghost")]))
    assert [part.link for part in parts] == ["base"]
    assert len(parts[0].body.collisions) == 2


def test_a_massless_link_with_a_mass_fixed_to_it_moves() -> None:
    links = [link("base"), link("hub", 0), link("tyre", 2)]
    parts = assemble(
        robot(links, [joint("j", "base", "hub"), joint("f", "hub", "tyre", "fixed", (0, 0, 1))])
    )
    assert [part.link for part in parts] == ["base", "hub"]
    assert parts[1].body.centre == (0, 0, 1)


def test_the_parts_weigh_what_the_robot_does() -> None:
    links = [link("base", 1), link("a", 2), link("b", 3), link("c", 4)]
    model = robot(
        links, [joint("j", "base", "a"), joint("f", "a", "b", "fixed"), joint("k", "base", "c")]
    )
    assert sum(part.body.mass for part in assemble(model)) == pytest.approx(lump(model).mass)


def test_a_part_touches_as_its_link_defines() -> None:
    smooth, rough = Surface(mu1=0.1), Surface(mu1=2.0)
    links = [link("base"), link("sensor", 0.1, rough, touches=False), link("skin", 0.1, smooth)]
    joints = [joint(f"f{name}", "base", name, "fixed") for name in ("sensor", "skin")]
    (part,) = assemble(robot(links, joints))
    assert part.surface == smooth  # the sensor touches nothing
