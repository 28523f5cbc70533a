"""A box stands for a mesh that cannot be used: that of the link's inertia, where it tells one."""

import pytest

from holozen.robot.parts import Pose, Shape
from holozen.robot.placeholder import placeholder
from holozen.robot.tag import Tag, read_xml

THERE = Pose((1, 2, 3))
MASS = '<mass value="12"/>'
INERTIA = '<inertia ixx="0.13" iyy="0.10" izz="0.05"/>'  # of 12 kg in a box of 0.1 x 0.2 x 0.3 m


def mesh(inertial: str) -> Tag:
    """The mesh of a link with these elements in its inertial."""
    link = f"<link><inertial>{inertial}</inertial><visual><geometry><mesh/></geometry></visual></link>"
    return next(read_xml(link, "a.urdf").below("mesh"))


def test_the_box_has_the_mass_and_moments_of_the_link_and_stands_at_its_centre_of_mass() -> None:
    box = placeholder(mesh(f'<origin xyz="0 0 0.5" rpy="0 0 1"/>{MASS}{INERTIA}'), THERE)
    assert box.kind == "box"
    assert box.size == pytest.approx((0.1, 0.2, 0.3))
    assert box.pose == Pose((0, 0, 0.5), (0, 0, 1))
    assert placeholder(mesh(MASS + INERTIA), THERE).pose == Pose()


def test_in_sdf_it_stands_where_the_mesh_would() -> None:
    inertia = "<ixx>0.13</ixx><iyy>0.10</iyy><izz>0.05</izz>"
    box = placeholder(mesh(f"<pose>0 0 9 0 0 0</pose><mass>12</mass><inertia>{inertia}</inertia>"), THERE)
    assert box.size == pytest.approx((0.1, 0.2, 0.3))
    assert box.pose == THERE


@pytest.mark.parametrize(
    "inertial",
    [
        "",
        MASS,
        INERTIA,
        '<mass value="0"/>' + INERTIA,
        '<mass value="x"/>' + INERTIA,
        MASS + '<inertia ixx="0.13" iyy="0.10"/>',
        MASS + '<inertia ixx="0.13" iyy="0.10" izz="x"/>',
        MASS + '<inertia ixx="0.5" iyy="0.10" izz="0.05"/>',
        MASS + '<inertia ixx="0" iyy="0" izz="0"/>',
        MASS + '<inertia ixx="100" iyy="100" izz="100"/>',
    ],
)
def test_where_the_inertia_is_that_of_no_small_body_it_is_a_cube_where_the_mesh_would_be(inertial: str) -> None:
    assert placeholder(mesh(inertial), THERE) == Shape("box", (0.1, 0.1, 0.1), THERE)


def test_an_inertial_frame_that_is_none_does_not_hide_the_mesh_s_own_fault() -> None:
    assert placeholder(mesh(f'<origin xyz="0 0 x"/>{MASS}{INERTIA}'), THERE).pose == THERE


def test_outside_of_any_link_it_is_a_cube() -> None:
    assert placeholder(read_xml("<mesh/>", "a.urdf"), THERE).size == (0.1, 0.1, 0.1)
