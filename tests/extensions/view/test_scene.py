"""How an entity follows the poses that it is told."""

import math
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import MagicMock

import pytest
import viser

from holozen.bus import Bus
from holozen.messages import Odometry, Point, Pose, Quaternion, SceneEntity
from holozen.testing import Wire
from holozen.view.instances import Body, Instances
from holozen.view.scene import Scene, Shown


@pytest.fixture
def shown() -> Shown:
    def add(*_: object, **__: object) -> Any:
        return SimpleNamespace()

    server = SimpleNamespace(scene=SimpleNamespace(add_frame=add, add_label=add))
    kind = SimpleNamespace(add=Body, changed=False, is_arrow=False)
    entity = SceneEntity("bot", odometry="odom")
    return Shown(
        cast("viser.ViserServer", server), cast("Bus", None), entity, cast("Instances", kind)
    )


def test_a_robot_that_no_sim_has_is_known_by_its_odom_alone(wire: Wire) -> None:
    """Filters publish odometry too, beside that of their robot or on keys like
    `odometry/filtered`.
    """
    keys, base = {"Fred/odom", "Fred/odom_filtered", "odometry/filtered"}, wire.bus("base")
    for key in keys:
        base.publisher(key, Odometry)
    scene = Scene(MagicMock(), wire.bus("view"))
    there = scene.ask().there
    while not scene.topics.keys() >= keys:
        there = scene.ask().there
    scene.close()
    assert [(one.name, one.odometry) for one in there.values()] == [("Fred", "Fred/odom")]


@pytest.mark.parametrize("bad", [(math.nan, 2.0, 0.0), (5.0, math.nan, 0.0), (5.0, math.inf, 0.0)])
def test_a_pose_that_is_not_finite_leaves_the_entity_where_it_is(
    shown: Shown, bad: tuple[float, float, float]
) -> None:
    shown.place(Pose(Point(1.0, 2.0, 0.0), Quaternion()))
    shown.place(Pose(Point(*bad), Quaternion()))
    assert shown.position == (1.0, 2.0, 0.0)
    shown.place(Pose(Point(1.0, 3.0, 0.0), Quaternion()))
    assert shown.position == (1.0, 3.0, 0.0)
