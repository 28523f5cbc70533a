"""How a robot stands."""

from math import atan, degrees

import pytest

from holozen.check.placed import Placed
from holozen.check.resting import stand
from holozen.robot.parts import Pose, Shape

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def ball(x: float, y: float, z: float, radius: float = 0.1) -> Placed:
    return Placed("ball", "collision", Shape("sphere", (radius,), Pose()), (x, y, z), AXES, (radius,) * 3)


def test_on_four_equal_balls_it_stands_level() -> None:
    balls = [ball(x, y, 0.1) for x in (-1, 1) for y in (-1, 1)]
    ground = stand(balls, (0.1, 0.2, 0.5))
    assert not ground.tips
    assert (ground.a, ground.b, ground.c) == pytest.approx((0, 0, 0), abs=1e-6)
    assert [ground.above(one) for one in balls] == pytest.approx([0, 0, 0, 0], abs=1e-6)


def test_on_three_balls_it_leans_until_all_touch() -> None:
    balls = [ball(1, -1, 0.1), ball(1, 1, 0.1), ball(-1, 0, 0.2)]
    ground = stand(balls, (0, 0, 0.5))
    assert ground.a == pytest.approx(-0.05, abs=1e-6)
    assert [ground.above(one) for one in balls] == pytest.approx([0, 0, 0], abs=1e-6)


def test_a_fourth_ball_in_the_air_stays_there() -> None:
    balls = [ball(1, -1, 0.1), ball(1, 1, 0.1), ball(-1, 0, 0.1), ball(0, 0, 0.15)]
    assert stand(balls, (0, 0, 0.5)).above(balls[3]) == pytest.approx(0.05, abs=1e-6)


def test_on_two_balls_it_tips() -> None:
    ground = stand([ball(0, -1, 0.1), ball(0, 1, 0.1)], (0.3, 0, 0.5))
    assert ground.tips
    assert degrees(atan(abs(ground.a))) == pytest.approx(20, abs=2)
