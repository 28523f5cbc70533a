"""How an entity follows the poses that it is told."""

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest
import viser

from holozen.bus import Bus
from holozen.messages import Point, Pose, Quaternion, SceneEntity
from services.view.instances import Body, Instances
from services.view.scene import Shown


@pytest.fixture
def shown() -> Shown:
    def add(*_: object, **__: object) -> Any:
        return SimpleNamespace()

    server = SimpleNamespace(scene=SimpleNamespace(add_frame=add, add_label=add))
    kind = SimpleNamespace(add=Body, changed=False, is_arrow=False)
    entity = SceneEntity("bot", odometry="odom")
    return Shown(cast("viser.ViserServer", server), cast("Bus", None), entity, cast("Instances", kind))


@pytest.mark.parametrize("bad", [(math.nan, 2.0, 0.0), (5.0, math.nan, 0.0), (5.0, math.inf, 0.0)])
def test_a_pose_that_is_not_finite_leaves_the_entity_where_it_is(shown: Shown, bad: tuple[float, float, float]) -> None:
    shown.place(Pose(Point(1.0, 2.0, 0.0), Quaternion()))
    shown.place(Pose(Point(*bad), Quaternion()))
    assert shown.position == (1.0, 2.0, 0.0)
    shown.place(Pose(Point(1.0, 3.0, 0.0), Quaternion()))
    assert shown.position == (1.0, 3.0, 0.0)
