"""A robot is put as high as its lowest collision point hangs under its root."""

import math
from pathlib import Path

import pytest
import trimesh

from holozen.robot.files.loading import load
from holozen.robot.files.meshes import hull
from holozen.robot.model import Joint, Limits, Link, Pose, RobotModel, Shape
from holozen.robot.rigid import lowest

REPO = Path(__file__).parents[3]
QUARTER = math.pi / 2
EIGHTH = math.pi / 4
CUBE = tuple((x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0))


def model(*shapes: Shape) -> RobotModel:
    """A root, and 1 m above it a link with the shapes."""
    links = {"root": Link("root", None, (), ()), "top": Link("top", None, (), shapes)}
    joint = Joint("j", "continuous", "root", "top", Pose((0, 0, 1)), (0, 0, 1), Limits())
    return RobotModel("r", "root", links, {"j": joint}, None)


def test_the_lowest_point_of_each_kind_of_shape() -> None:
    for shape, rpy, low in [
        (Shape("box", (1, 2, 3), Pose()), (0, 0, 0), -0.5),
        (Shape("box", (1, 2, 3), Pose((0, 0, 5))), (0, 0, 0), 4.5),
        (Shape("box", (1, 2, 3), Pose()), (0, 0, 1), -0.5),
        (Shape("box", (1, 2, 3), Pose((0, 0, -1))), (QUARTER, 0, 0), -1),
        (Shape("box", (1, 2, 3), Pose((0, 0, -1))), (0, QUARTER, 0), -0.5),
        (Shape("box", (2, 2, 2), Pose((0, 0, -1))), (EIGHTH, 0, 0), -math.sqrt(2)),
        (Shape("box", (1, 2, 3), Pose(rpy=(QUARTER, 0, 0))), (0, 0, 0), 0),
        (Shape("box", (1, 1, 1), Pose()), (math.pi, 0, 0), -1.5),
        (Shape("sphere", (0.25,), Pose()), (0, 0, 0), 0.75),
        (Shape("cylinder", (0.5, 4), Pose()), (0, 0, 0), -1),
        (Shape("cylinder", (0.5, 4), Pose(rpy=(QUARTER, 0, 0))), (0, 0, 0), 0.5),
        (Shape("cylinder", (1, 2), Pose(rpy=(0, EIGHTH, 0))), (0, 0, 0), 1 - math.sqrt(2)),
        (Shape("hull", (), Pose(), points=CUBE), (0, 0, 0), 0),
        (Shape("hull", (), Pose(rpy=(0, EIGHTH, 0)), points=CUBE), (0, 0, 0), 1 - math.sqrt(2)),
        (Shape("plane", (1, 1), Pose()), (0, 0, 0), 0),
        (Shape("mesh", (1, 1, 1), Pose()), (0, 0, 0), 0),
    ]:
        assert lowest(model(shape), rpy) == pytest.approx(low)


def test_the_lowest_of_all_shapes_counts() -> None:
    low = Shape("sphere", (0.5,), Pose((0, 0, -3)))
    assert (
        lowest(model(Shape("sphere", (0.5,), Pose()), low, Shape("plane", (1, 1), Pose()))) == -2.5
    )


def test_a_mesh_is_as_low_as_its_file_has_it(tmp_path: Path) -> None:
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.stl")
    points = hull(tmp_path / "box.stl", (1, 1, 2))
    assert lowest(
        model(Shape("mesh", (1, 1, 2), Pose(), tmp_path / "box.stl", points=points))
    ) == pytest.approx(-2)


def test_without_a_collision_shape_the_root_is_the_lowest() -> None:
    assert str(lowest(model())) == "0.0"


def test_the_lesson_s_robot_settles_four_centimetres_below_its_root() -> None:
    assert lowest(load(REPO / "urdf" / "hb_bot.urdf.xacro")) == pytest.approx(0.04)
