"""A robot lumped into one body has the mass, centre and inertia of all its points."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from holozen import data
from holozen.robot.errors import RobotError
from holozen.robot.files.loading import load
from holozen.robot.model import Inertial, Joint, Limits, Link, Pose, RobotModel, Shape
from holozen.robot.rigid import (
    Body,
    advised_drive,
    footprint_radius,
    joint_axes,
    link_frames,
    lump,
    turning_point,
)
from holozen.robot.rotation import Array, matrix_of, triple

REPO = Path(__file__).parents[3]


def matrix_of_quaternion(quaternion: Sequence[float]) -> Array:
    x, y, z, w = quaternion
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix: Array = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    return matrix


def tensor(body: Body) -> Array:
    axes = matrix_of_quaternion(body.axes)
    return axes @ np.diag(body.inertia) @ axes.T


def tensor_of_points(masses: Array, points: Array) -> Array:
    """The sum over the points of m (|r|^2 1 - r r^T), about their centre of mass."""
    away = points - masses @ points / masses.sum()
    parts = [m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, away, strict=True)]
    total: Array = np.sum(parts, axis=0)
    return total


def inertial_of_points(masses: Array, points: Array, rpy: tuple[float, float, float]) -> Inertial:
    """The inertial element of a link made of these points, with its frame turned by `rpy`."""
    turn = matrix_of(rpy)
    inertia = turn.T @ tensor_of_points(masses, points) @ turn
    centre = masses @ points / masses.sum()
    xx, xy, xz, yy, yz, zz = (
        float(inertia[i, j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    )
    return Inertial(Pose(triple(centre), rpy), float(masses.sum()), (xx, xy, xz, yy, yz, zz))


def model_of(links: list[Link], joints: list[Joint]) -> RobotModel:
    named_links, named_joints = (
        {link.name: link for link in links},
        {joint.name: joint for joint in joints},
    )
    return RobotModel("r", links[0].name, named_links, named_joints, None, ())


def fixed(
    parent: str, child: str, pose: Pose, kind: str = "fixed", axis: Sequence[float] = (1, 0, 0)
) -> Joint:
    return Joint(f"{child}_joint", kind, parent, child, pose, triple(axis), Limits())


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_a_lumped_robot_equals_the_cloud_of_its_points(size: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    links, joints, clouds = [], [], []
    turns, places = [np.eye(3)], [np.zeros(3)]
    for i in range(size):
        masses, points = random.uniform(0.1, 2, 8), random.uniform(-1, 1, (8, 3))
        links.append(
            Link(
                f"l{i}",
                inertial_of_points(masses, points, triple(random.uniform(-4, 4, 3))),
                (),
                (),
            )
        )
        if i > 0:
            above, pose = (
                int(random.integers(i)),
                Pose(*(triple(random.uniform(-3, 3, 3)) for _ in range(2))),
            )
            joints.append(fixed(f"l{above}", f"l{i}", pose))
            places.append(places[above] + turns[above] @ pose.xyz)
            turns.append(turns[above] @ matrix_of(pose.rpy))
        clouds.append((masses, places[i] + points @ turns[i].T))
    masses, points = (np.concatenate(part) for part in zip(*clouds, strict=True))
    # The joints backwards: a file may name a child before its parent.
    body = lump(model_of(links, joints[::-1]))
    assert body.mass == pytest.approx(masses.sum())
    np.testing.assert_allclose(body.centre, masses @ points / masses.sum(), atol=1e-9)
    np.testing.assert_allclose(tensor(body), tensor_of_points(masses, points), atol=1e-8)


def test_two_point_masses_on_a_bar_have_the_inertia_of_the_textbook() -> None:
    point = Inertial(Pose(), 2.0, (0, 0, 0, 0, 0, 0))
    links = [Link("a", point, (), ()), Link("b", point, (), ())]
    body = lump(model_of(links, [fixed("a", "b", Pose((0, 0, 3)))]))
    # Two masses of 2 kg, each 1.5 m off the centre: 2 * 2 * 1.5^2 = 9; about the bar nothing but
    # the floor.
    assert body.inertia == pytest.approx((9, 9, 4e-6))
    assert (body.mass, body.centre, body.axes) == (4, (0, 0, 1.5), (0, 0, 0, 1))


def test_a_single_point_mass_gets_the_least_inertia_that_an_engine_can_divide_by() -> None:
    body = lump(model_of([Link("a", Inertial(Pose(), 2.0, (0, 0, 0, 0, 0, 0)), (), ())], []))
    assert body.inertia == pytest.approx((2e-6, 2e-6, 2e-6))


def test_links_without_mass_lend_their_shapes_and_nothing_else() -> None:
    box = Shape("box", (1, 1, 1), Pose((0, 0, 1), (0, 0, math.pi / 2)))
    heavy = Link("a", Inertial(Pose((1, 0, 0)), 3.0, (1, 0, 0, 2, 0, 3)), (), ())
    bare, zero = (
        Link("b", None, (), (box,)),
        Link("c", Inertial(Pose(), 0.0, (0, 0, 0, 0, 0, 0)), (), ()),
    )
    away = Pose((0, 5, 0), (math.pi / 2, 0, 0))
    body = lump(model_of([heavy, bare, zero], [fixed("a", "b", away), fixed("a", "c", away)]))
    assert (body.mass, body.centre, body.inertia) == (3, (1, 0, 0), (1, 2, 3))
    (placed,) = body.collisions
    assert (placed.link, placed.shape) == ("b", box)
    # One metre along b's z, which a quarter turn about x has laid along -y.
    assert placed.xyz == pytest.approx((0, 4, 0))
    expected = matrix_of((math.pi / 2, 0, 0)) @ matrix_of((0, 0, math.pi / 2))
    np.testing.assert_allclose(matrix_of_quaternion(placed.quaternion), expected, atol=1e-12)


@pytest.mark.parametrize("mass", [None, 0.0, 1e-9])
def test_a_robot_without_mass_is_refused(mass: float | None) -> None:
    inertial = None if mass is None else Inertial(Pose(), mass, (0, 0, 0, 0, 0, 0))
    with pytest.raises(
        RobotError,
        match=r"robot 'r' has a mass of .* kg; give a link an <inertial> with a <mass> of",
    ):
        lump(model_of([Link("a", inertial, (), ())], []))


def test_frames_add_up_from_the_root_to_the_leaves() -> None:
    quarter = Pose((1, 0, 0), (0, 0, math.pi / 2))
    links = [Link(name, None, (), ()) for name in "abc"]
    frames = link_frames(model_of(links, [fixed("b", "c", quarter), fixed("a", "b", quarter)]))
    assert list(frames) == ["a", "b", "c"]
    assert frames["a"].xyz == (0, 0, 0) and frames["a"].quaternion == (0, 0, 0, 1)
    assert frames["b"].xyz == (1, 0, 0)
    assert frames["c"].xyz == pytest.approx((1, 1, 0))
    assert frames["c"].quaternion == pytest.approx((0, 0, 1, 0))


def test_the_axis_of_a_joint_is_in_the_root_frame() -> None:
    links = [Link(name, None, (), ()) for name in "abcde"]
    turned = Pose((1, 0, 0), (0, 0, math.pi / 2))
    joints = [
        fixed("a", "b", turned, "continuous", (0, 1, 0)),
        fixed("b", "c", turned, "prismatic", (1, 0, 0)),
        fixed("a", "d", turned),
        fixed("a", "e", turned, "revolute", (0, 0, 1)),
    ]
    axes = joint_axes(model_of(links, joints))
    assert list(axes) == ["b_joint", "c_joint", "e_joint"]
    assert axes["b_joint"].xyz == pytest.approx((1, 0, 0))
    assert axes["b_joint"].direction == pytest.approx((-1, 0, 0))
    assert axes["c_joint"].direction == pytest.approx((-1, 0, 0))


def test_hb_bot_weighs_what_its_links_weigh_and_its_axles_point_outwards() -> None:
    model = load(REPO / "urdf" / "hb_bot.urdf.xacro")
    body = lump(model)
    assert body.mass == pytest.approx(
        sum(link.inertial.mass for link in model.links.values() if link.inertial)
    )
    axes = joint_axes(model)
    assert len(axes) == 3 and len(body.collisions) == 4
    for axis in axes.values():
        outwards = np.array(axis.xyz[:2]) / math.hypot(*axis.xyz[:2])
        np.testing.assert_allclose(axis.direction, (*outwards, 0), atol=1e-12)


def test_a_heavier_link_draws_the_centre_of_mass_to_itself() -> None:
    model = load(REPO / "urdf" / "hb_bot.urdf.xacro")
    wheel = model.links["front_wheel_link"]
    assert wheel.inertial is not None
    heavy = replace(wheel, inertial=replace(wheel.inertial, mass=100.0))
    centre = lump(replace(model, links={**model.links, heavy.name: heavy})).centre
    assert centre[1] > 0.67


def test_a_robot_on_omni_wheels_is_advised_to_drive_them() -> None:
    advice = {
        name: advised_drive(load(data.find("urdf", f"{name}.urdf.xacro")))
        for name in ("hb_bot", "differential")
    }
    assert advice == {"hb_bot": "omni", "differential": "planar_move"}


def test_a_footprint_holds_all_shapes_around_the_point_that_the_robot_turns_about() -> None:
    hb_bot = load(REPO / "urdf" / "hb_bot.urdf.xacro")
    corner = math.hypot(math.hypot(0.58, 0.36) + 0.13 / 2, 0.14)  # of a wheel, across its axle
    assert turning_point(hb_bot) == (0, 0, 0)
    assert footprint_radius(hb_bot) == pytest.approx(corner, rel=2e-3)
    differential = load(REPO / "urdf" / "differential.urdf.xacro")
    ahead = replace(differential.joints["base_joint"], pose=Pose((0.3, 0, 0.06)))
    moved = replace(differential, joints={**differential.joints, "base_joint": ahead})
    assert turning_point(moved) == pytest.approx((0.3, 0, 0.06))
    behind = math.hypot(0.34 / 2 + 0.08, 0.26 / 2)  # the body's middle is behind the axle
    for robot in (differential, moved):
        assert footprint_radius(robot) == pytest.approx(behind, rel=2e-3)
    bare = replace(hb_bot, links={"a": Link("a", None, (), ())}, joints={}, root="a")
    assert footprint_radius(bare) == 0
