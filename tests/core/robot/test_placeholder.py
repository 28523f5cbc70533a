"""A box stands for a mesh that cannot be used: that of the link's inertia, where it gives one."""

import pytest

from holozen.robot.files.elements import Tag, read_xml
from holozen.robot.files.shapes import placeholder
from holozen.robot.model import Pose, Shape

THERE = Pose((1, 2, 3))
MASS = '<mass value="12"/>'
INERTIA = '<inertia ixx="0.13" iyy="0.10" izz="0.05"/>'  # of 12 kg in a box of 0.1 x 0.2 x 0.3 m


def mesh(inertial: str, beside: str = "", root: str = "robot") -> Tag:
    """The mesh of a link with these elements in its inertial and beside it, in URDF or SDF."""
    link = f"<link><inertial>{inertial}</inertial>{beside}<visual><geometry><mesh/></geometry></visual></link>"  # noqa: E501
    return next(read_xml(f"<{root}>{link}</{root}>", "a.urdf").below("mesh"))


def test_the_box_has_the_mass_and_moments_of_the_link_and_stands_at_its_centre_of_mass() -> None:
    box = placeholder(mesh(f'<origin xyz="0 0 0.5" rpy="0 0 1"/>{MASS}{INERTIA}'), THERE)
    assert box.kind == "box"
    assert box.size == pytest.approx((0.1, 0.2, 0.3))
    assert box.pose == Pose((0, 0, 0.5), (0, 0, 1))
    assert placeholder(mesh(MASS + INERTIA), THERE).pose == Pose()


def test_in_sdf_it_stands_where_the_mesh_would() -> None:
    inertia = "<ixx>0.13</ixx><iyy>0.10</iyy><izz>0.05</izz>"
    box = placeholder(
        mesh(f"<pose>0 0 9 0 0 0</pose><mass>12</mass><inertia>{inertia}</inertia>", root="sdf"),
        THERE,
    )
    assert box.size == pytest.approx((0.1, 0.2, 0.3))
    assert box.pose == THERE


def test_where_the_inertia_is_that_of_no_small_body_it_is_a_cube_where_the_mesh_would_be() -> None:
    for inertial in [
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
    ]:
        assert placeholder(mesh(inertial), THERE) == Shape("box", (0.1, 0.1, 0.1), THERE)


def test_an_inertial_frame_that_is_none_does_not_hide_the_mesh_s_own_fault() -> None:
    assert placeholder(mesh(f'<origin xyz="0 0 x"/>{MASS}{INERTIA}'), THERE).pose == THERE


def test_what_is_seen_has_the_size_of_what_is_touched() -> None:
    for shape, size in [
        ('<box size="0.4 0.5 0.6"/>', (0.4, 0.5, 0.6)),
        ('<cylinder radius="0.2" length="0.1"/>', (0.4, 0.4, 0.1)),
        ('<sphere radius="0.7"/>', (1.4, 1.4, 1.4)),
        ("<box><size>0.4 0.5 0.6</size></box>", (0.4, 0.5, 0.6)),
        ("<cylinder><radius>0.2</radius><length>0.1</length></cylinder>", (0.4, 0.4, 0.1)),
    ]:
        small = '<collision><geometry><box size="0.01 0.01 0.01"/></geometry></collision>'
        origin = '<origin xyz="0 0 0.5"/>'
        sdf = "><" in shape
        beside = f"{small}<collision>{origin}<geometry>{shape}</geometry></collision>"
        link = mesh(MASS + INERTIA, beside, "sdf" if sdf else "robot")
        assert placeholder(link, THERE) == Shape("box", size, THERE if sdf else Pose((0, 0, 0.5)))


def test_a_collision_shape_without_a_size_is_ignored() -> None:
    for shape in [
        '<mesh filename="x"/>',
        '<box size="1 2"/>',
        '<sphere radius="0"/>',
        '<cylinder radius="x" length="1"/>',
        "",
    ]:
        link = mesh(MASS + INERTIA, f"<collision><geometry>{shape}</geometry></collision>")
        assert placeholder(link, THERE).size == pytest.approx((0.1, 0.2, 0.3))


def test_what_is_touched_has_not_the_size_of_another_collision() -> None:
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    link = f"<link>{box}<collision><geometry><mesh/></geometry></collision></link>"
    assert placeholder(next(read_xml(link, "a.urdf").below("mesh")), THERE).size == (0.1, 0.1, 0.1)


def test_an_inertia_makes_no_box_that_hides_the_robot() -> None:
    # of a cube with edges of 1.3 m
    great = '<mass value="1"/><inertia ixx="0.3" iyy="0.3" izz="0.3"/>'
    assert placeholder(mesh(great), THERE).size == pytest.approx((0.3, 0.3, 0.3))


def test_outside_of_any_link_it_is_a_cube() -> None:
    assert placeholder(read_xml("<mesh/>", "a.urdf"), THERE).size == (0.1, 0.1, 0.1)
