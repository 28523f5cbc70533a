"""Where a click on the ground is, and the same point in a robot's odometry."""

import math

import pytest

from holozen.messages import Point, Pose, Quaternion
from holozen.view.drive import in_odometry
from holozen.view.world import on_ground

HALF = math.sin(math.pi / 4)


def test_a_ray_meets_the_ground_in_front_of_the_eye_alone() -> None:
    assert on_ground((1.0, 2.0, 2.0), (0.5, 0.0, -1.0)) == pytest.approx((2.0, 2.0))
    assert on_ground((0.0, 0.0, 2.0), (1.0, 0.0, 0.1)) is None, "towards the sky"
    assert on_ground((0.0, 0.0, -2.0), (1.0, 0.0, -0.1)) is None, "from below"
    assert on_ground((0.0, 0.0, 2.0), (1.0, 0.0, -0.001)) is None, "beyond the floor"


def test_odometry_that_began_elsewhere_has_the_point_elsewhere() -> None:
    true = Pose(Point(2.0, 1.0, 0.0), Quaternion(0, 0, HALF, HALF))  # faces +y
    measured = Pose(Point(0.0, 0.0, 0.0))  # began where it stands
    assert in_odometry((2.0, 3.0, 0.0), true, measured) == pytest.approx((2.0, 0.0, 0.0)), (
        "2 m ahead"
    )


def test_a_true_pose_of_a_moment_before_changes_nothing() -> None:
    true, measured = (
        Pose(Point(2.0, 1.0, 0.0)),
        Pose(Point(2.04, 1.0, 0.0), Quaternion(0, 0, 0.03, 0.9995)),
    )
    assert in_odometry((5.0, 3.0, 0.0), true, measured) == (5.0, 3.0, 0.0)
