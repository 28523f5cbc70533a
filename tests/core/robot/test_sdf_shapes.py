"""SDF's shapes have the size, place and colour that the file gives them."""

import math
from pathlib import Path

import numpy as np
import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Source
from holozen.robot.files.sdf_models import read_models
from holozen.robot.model import Shape
from holozen.robot.rotation import matrix_of


def read(
    geometry: str, more: str = "", use: str = "collision", home: Path = Path("a.sdf")
) -> tuple[Shape, ...]:
    shape = f'<{use} name="c"><geometry>\n{geometry}</geometry>{more}</{use}>'
    text = (
        '<sdf version="1.9"><model name="m"><static>1</static><link '
        f'name="a">{shape}</link></model></sdf>'
    )
    source = Source(home, {})
    (model,) = read_models(text, source)
    assert list(model.warnings) == source.warnings
    return model.links["a"].collisions if use == "collision" else model.links["a"].visuals


def hull_of(geometry: str) -> np.ndarray:
    (shape,) = read(geometry)
    assert shape.kind == "hull" and shape.size == ()
    return np.array(shape.points)


def test_a_shape_has_its_size() -> None:
    for geometry, kind, size in [
        ("<box><size>1 2 3</size></box>", "box", (1, 2, 3)),
        ("<sphere><radius>0.5</radius></sphere>", "sphere", (0.5,)),
        ("<cylinder><radius>0.5</radius><length>2</length></cylinder>", "cylinder", (0.5, 2)),
        ("<cylinder><length>2</length><radius>0.5</radius></cylinder>", "cylinder", (0.5, 2)),
        ("<plane><size>4 5</size></plane>", "plane", (4, 5)),
        ("<plane/>", "plane", (1, 1)),
    ]:
        (shape,) = read(geometry)
        assert (shape.kind, shape.size, shape.pose.xyz) == (kind, size, (0, 0, 0))


def test_a_planes_z_is_its_normal() -> None:
    for normal in [(0, 0, 1), (0, 0, -2), (1, 0, 0), (0, -1, 0), (0.3, -0.4, 0.5)]:
        (shape,) = read(
            f"<plane><normal>{' '.join(map(str, normal))}</normal></plane>",
            "<pose>0 0 0 0 0 0.7</pose>",
        )
        up = matrix_of((0, 0, 0.7)) @ (np.array(normal) / math.hypot(*normal))
        np.testing.assert_allclose(matrix_of(shape.pose.rpy)[:, 2], up, atol=1e-12)


def test_a_capsule_is_a_hull_as_long_as_its_cylinder_and_two_radii() -> None:
    points = hull_of("<capsule><radius>0.5</radius><length>2</length></capsule>")
    np.testing.assert_allclose(np.abs(points).max(axis=0), (0.5, 0.5, 1.5), atol=1e-12)
    ends = points - np.outer(np.sign(points[:, 2]), (0, 0, 1))
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 0.5)


def test_an_ellipsoid_is_a_hull_with_its_three_radii() -> None:
    points = hull_of("<ellipsoid><radii>1 2 3</radii></ellipsoid>")
    np.testing.assert_allclose(np.abs(points).max(axis=0), (1, 2, 3), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(points / (1, 2, 3), axis=1), 1)


def test_a_cone_points_up() -> None:
    points = hull_of("<cone><radius>0.5</radius><length>2</length></cone>")
    assert points[points[:, 2] > -1].tolist() == [[0, 0, 1]]
    np.testing.assert_allclose(np.hypot(*points[points[:, 2] == -1, :2].T), 0.5)


@pytest.mark.parametrize("geometry", ["<heightmap/>", "<polyline/>", "<image/>"])
def test_what_is_not_simulated_is_left_out_with_a_warning(geometry: str) -> None:
    text = (
        '<sdf><model name="m"><static>1</static><link name="a"><collision '
        f'name="c"><geometry>{geometry}</geometry>'
    )
    (model,) = read_models(f"{text}</collision></link></model></sdf>", Source(Path("a.sdf"), {}))
    assert model.links["a"].collisions == ()
    assert model.warnings[0].startswith(
        f"a.sdf, line 1: {geometry[:-2]}> of <collision name='c'> (collision) is left out"
    )


def test_an_empty_geometry_is_nothing() -> None:
    assert read("<empty/>") == ()


def test_a_visual_has_its_materials_colour() -> None:
    for material, color in [
        ("<diffuse>0.1 0.2 0.3 0.4</diffuse><ambient>1 1 1 1</ambient>", (0.1, 0.2, 0.3, 0.4)),
        ("<ambient>1 0 1 1</ambient>", (1, 0, 1, 1)),
        ("<diffuse>1 0 1</diffuse>", (1, 0, 1, 1)),
        ("<script><uri>file://any</uri><name>Gazebo/Red</name></script>", (1, 0, 0, 1)),
        ("<script><name>Gazebo/Redd</name></script>", None),
        ("", None),
    ]:
        (shape,) = read(
            "<box><size>1 1 1</size></box>", f"<material>{material}</material>", "visual"
        )
        assert shape.color == color


def test_transparency_makes_a_colour_see_through() -> None:
    more = "<material><diffuse>1 1 1 0.5</diffuse></material><transparency>0.75</transparency>"
    (shape,) = read("<box><size>1 1 1</size></box>", more, "visual")
    assert shape.color == (1, 1, 1, 0.125)


def test_a_mesh_is_found_beside_the_file_with_its_scale(home: Path) -> None:
    (home / "meshes").mkdir()
    (home / "meshes" / "a.stl").write_bytes(b"solid\nendsolid\n")
    geometry = "<mesh><uri>meshes/a.stl</uri><scale>1 2 3</scale></mesh>"
    (shape,) = read(geometry, use="visual", home=home / "a.sdf")
    assert (shape.kind, shape.size, shape.path) == ("mesh", (1, 2, 3), home / "meshes" / "a.stl")


def test_a_missing_mesh_is_a_box_with_a_warning(home: Path) -> None:
    geometry = "<mesh><uri>model://nothing/a.stl</uri></mesh>"
    (shape,) = read(geometry, home=home / "a.sdf")
    assert shape.kind == "box"


def test_a_shape_that_is_none_is_one_line() -> None:
    for geometry, message in [
        (
            "",
            "<geometry> of <collision name='c'> contains nothing; it must contain <box>, "
            "<sphere>, <cylinder>",
        ),
        ("<blob/>", "contains <blob>; it must contain <box>"),
        ("<box/>", "<box> of <collision name='c'> has no <size>"),
        (
            "<box><size>1 1</size></box>",
            "<size> of <collision name='c'>: '1 1' has 2 numbers instead of 3",
        ),
        (
            "<box><size>1 1 0</size></box>",
            "has the size (1.0, 1.0, 0.0) m; each number must be 1e-06 or more",
        ),
        ("<box><size>1 1 nan</size></box>", "'nan' is not a finite number"),
        ("<sphere><radius>0</radius></sphere>", "has the size (0.0,) m"),
        ("<sphere><radius>-1</radius></sphere>", "has the size (-1.0,) m"),
        (
            "<cylinder><radius>1</radius></cylinder>",
            "<cylinder> of <collision name='c'> has no <length>",
        ),
        (
            "<cylinder><radius>1</radius><length>1e400</length></cylinder>",
            "'1e400' is not a finite number",
        ),
        ("<ellipsoid><radii>1 0 1</radii></ellipsoid>", "has the size (1.0, 0.0, 1.0) m"),
        ("<plane><size>0 1</size></plane>", "has the size (0.0, 1.0) m"),
        (
            "<plane><normal>0 0 0</normal></plane>",
            "<plane> of <collision name='c'> has no direction in normal",
        ),
        ("<mesh/>", "<mesh> of <collision name='c'> has no <uri>"),
    ]:
        with pytest.raises(RobotError) as error:
            read(geometry)
        assert message in str(error.value)
        assert str(error.value).startswith(
            "a.sdf, line " + ("1" if "<geometry>" in message or "; it must" in message else "2")
        )
