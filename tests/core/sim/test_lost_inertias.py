"""Robots whose files leave out <inertia> stand on the ground of the real engine like any other."""

import math
import re
from pathlib import Path

import pytest

from holozen.limits import STOP
from holozen.robot.files.loading import parse
from holozen.robot.files.xacro import expand_xacro
from holozen.robot.rigid import lowest, lump
from services.sim.physics.movers import mover_for
from services.sim.physics.world import World

ROVER = Path(__file__).parents[3] / "urdf" / "rover.urdf.xacro"
DT = 1 / 240
BOX = parse(
    '<robot name="box"><link name="box"><inertial><mass value="1"/></inertial>'
    '<collision><geometry><box size="0.3 0.3 0.3"/></geometry></collision></link></robot>',
    Path("box.urdf"),
)


@pytest.mark.parametrize("jointed", [True, False])
def test_a_box_without_inertia_rests_on_the_ground(ground: World, jointed: bool) -> None:
    at = (0.0, 0.0, 0.16)
    body = ground.add_jointed(BOX, at) if jointed else ground.add(lump(BOX), at)
    for _ in range(round(3 / DT)):
        ground.step()
    position, rotation = body.pose()
    assert position == pytest.approx((0, 0, 0.15), abs=2e-3)
    assert rotation == pytest.approx((0, 0, 0, 1), abs=1e-3)
    linear, angular = body.twist()
    assert math.hypot(*linear) < 1e-3 and math.hypot(*angular) < 1e-2


def test_a_rover_without_any_inertia_stands_still(ground: World) -> None:
    text, count = re.subn(r"<inertia .*?/>", "", expand_xacro(ROVER), flags=re.DOTALL)
    assert count >= 2
    model = parse(text, ROVER)
    mover = mover_for(ground, model, (0, 0, -lowest(model)))
    for second in range(4):
        for _ in range(round(1 / DT)):
            mover.move(STOP, DT)
            ground.step()
            linear, angular = mover.body.twist()
            assert not second or max(math.hypot(*linear), 0.1 * math.hypot(*angular)) < 1e-3
