"""What rays hit: the links of other entities, and those of the sensor's own robot, except the link
that carries it.
"""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from holozen.robot.files.loading import parse
from holozen.robot.model import RobotModel, WorldSpec
from services.sim.link_states import LinkState, LinkTree
from services.sim.physics.engine import Array
from services.sim.physics.ray_caster import RayCaster
from services.sim.physics.world import World

pytestmark = pytest.mark.engines
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
X, Y, DOWN = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, 0.0, -1.0]])


def box(size: float) -> str:
    return f"<collision><geometry><box size='{size} {size} {size}'/></geometry></collision>"


def robot() -> RobotModel:
    text = f"""<robot name="r"><link name="head">{box(0.5)}</link><link name="arm">{box(0.2)}</link>
    <joint name="j" type="prismatic"><origin xyz="1 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="9"/>
    <parent link="head"/><child link="arm"/></joint></robot>"""  # noqa: E501
    return parse(text, Path("r.urdf"))


@pytest.fixture
def rays(engine: str) -> Iterator[RayCaster]:
    with closing(World(WorldSpec(ground=True), engine).ray_caster()) as rays:
        yield rays


def place(
    rays: RayCaster, name: str, model: RobotModel, x: float, y: float, arm: float = 0.0
) -> None:
    root = (x, y, 1.0), UPRIGHT
    rays.place(name, root, LinkTree(model).states(LinkState(*root), {"j": arm}))


def test_the_link_that_carries_the_sensor_is_not_hit_but_the_others_are(rays: RayCaster) -> None:
    model = robot()
    rays.add("r", model)
    place(rays, "r", model, 0.0, 0.0)
    origin = (-0.2, 0.0, 1.0)  # within the head, and behind its middle
    assert rays.ranges(origin, UPRIGHT, X, 0.0, 5.0, ("r", "head")) == pytest.approx([1.1])
    assert rays.ranges((-3, 0, 1), UPRIGHT, X, 0.0, 5.0, ("r", "head")) == pytest.approx([3.9])
    assert rays.ranges((-3, 0, 1), UPRIGHT, X, 0.0, 5.0, ("r", "arm")) == pytest.approx([2.75])
    place(rays, "r", model, 0.0, 0.0, arm=2.0)
    assert rays.ranges(origin, UPRIGHT, X, 0.0, 5.0, ("r", "head")) == pytest.approx([3.1])
    assert rays.ranges(origin, UPRIGHT, X, 0.0, 3.0, ("r", "head")) == [np.inf]
    assert rays.ranges(origin, UPRIGHT, DOWN, 0.0, 3.0, ("r", "head")) == pytest.approx([1.0]), (
        "the ground"
    )


def test_an_entity_is_seen_where_it_is_until_it_is_removed(rays: RayCaster) -> None:
    model = robot()
    for name in ("own", "other"):
        rays.add(name, model)
        place(rays, name, model, 0.0, 3.0 if name == "other" else 0.0)

    def looks() -> Array:
        return rays.ranges((0, 0, 1), UPRIGHT, Y, 0.1, 9.0, ("own", "head"))

    assert looks() == pytest.approx([2.75])
    assert rays.has_moved("other", ((0, 4, 1), UPRIGHT)) and not rays.has_moved(
        "own", ((0.0, 0.0, 1.0), UPRIGHT)
    )
    place(rays, "other", model, 0.0, 4.0)
    assert looks() == pytest.approx([3.75])
    rays.remove("other")
    assert looks() == [np.inf]


def test_what_touches_a_link_is_named_with_place_normal_and_depth(rays: RayCaster) -> None:
    model = robot()
    for name in ("own", "other"):
        rays.add(name, model)
    place(rays, "own", model, 0.0, 0.0, arm=-0.8)  # its arm is in its head
    place(rays, "other", model, 0.501, 0.1)
    (touch,) = rays.touches("own", "head")
    assert touch.other == ("other", "head")
    for point, normal in zip(touch.points, touch.normals, strict=True):
        assert (point[0], *normal) == pytest.approx((0.251, -1, 0, 0), abs=1e-3)
    assert touch.depths == pytest.approx([0.0] * len(touch.points))
    place(rays, "other", model, 0.49, 0.1)
    (touch,) = rays.touches("own", "head")
    assert touch.depths == pytest.approx([0.01] * len(touch.points), abs=1e-3)
    assert touch.normals == [pytest.approx((-1, 0, 0), abs=1e-3)] * len(touch.points)
    place(rays, "other", model, 0.51, 0.1)
    assert rays.touches("own", "head") == []
    rays.place(
        "own",
        ((0.0, 0.0, 0.25), UPRIGHT),
        LinkTree(model).states(LinkState((0.0, 0.0, 0.25), UPRIGHT), {}),
    )
    (touch,) = rays.touches("own", "head")
    assert touch.other == ("ground_plane", "link")
    assert touch.normals == [pytest.approx((0, 0, 1), abs=1e-3)] * len(touch.points)
