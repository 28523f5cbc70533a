"""Each renderer's pictures, against geometry and against each other."""

import math
from typing import Any

import numpy as np
import pytest

from holozen.messages import Exposure, Point, Pose, Quaternion, SeenEntity
from holozen.robot.files.description import Appearance, read
from services.camera.picture import Picture

from .conftest import renderers

WIDTH, HEIGHT, ACROSS = 160, 120, 1.2  # pixels, rad
FOCAL = WIDTH / 2 / math.tan(ACROSS / 2)
HIGH = 0.5  # m; of the camera
TILT = 0.5  # rad


def looks(geometry: str, color: str = "1 0 0 1") -> Appearance:
    """What an object of one visual shape looks like."""
    visual = (
        f"<visual><geometry>{geometry}</geometry><material name='m'><color "
        f"rgba='{color}'/></material></visual>"
    )
    return read(f"<robot name='one'><link name='a'>{visual}</link></robot>")


def picture(renderer: Any, *placed: tuple[Appearance, Pose], ground: bool = False) -> Picture:
    """What a camera sees that looks along x from HIGH above the origin."""
    for number, (look, _) in enumerate(placed):
        renderer.add(f"entity {number}", number, look)
    entities = [
        SeenEntity(f"entity {number}", number, ["a"], [pose])
        for number, (_, pose) in enumerate(placed)
    ]
    exposure = Exposure(
        image="image_raw",
        info="camera_info",
        width=WIDTH,
        height=HEIGHT,
        field_of_view=ACROSS,
        near=0.05,
        far=20.0,
        encoding="rgb8",
        pose=Pose(Point(0.0, 0.0, HIGH)),
        ground=ground,
        entities=entities,
    )
    found: Picture = renderer.render(exposure)
    return found


def test_a_red_box_is_where_geometry_puts_it(renderer: Any) -> None:
    edge, at = 0.4, Point(2.0, 0.5, HIGH)
    seen = picture(renderer, (looks(f"<box size='{edge} {edge} {edge}'/>"), Pose(at)))
    red = (seen.colors[:, :, 0] > 60) & (seen.colors[:, :, 1] < 30)
    rows, columns = np.nonzero(red)
    near, back = at.x - edge / 2, at.x + edge / 2
    assert columns.min() == pytest.approx(WIDTH / 2 - FOCAL * (at.y + edge / 2) / near, abs=1.5)
    assert columns.max() + 1 == pytest.approx(WIDTH / 2 - FOCAL * (at.y - edge / 2) / back, abs=1.5)
    assert rows.min() == pytest.approx(HEIGHT / 2 - FOCAL * edge / 2 / near, abs=1.5)
    assert rows.max() + 1 == pytest.approx(HEIGHT / 2 + FOCAL * edge / 2 / near, abs=1.5)
    assert seen.depth[HEIGHT // 2, round(WIDTH / 2 - FOCAL * at.y / near)] == pytest.approx(
        near, abs=0.01
    )
    assert (np.isfinite(seen.depth) == red).mean() > 0.99, "there is nothing else"


def test_a_box_is_where_geometry_puts_it_within_a_fifth_of_a_pixel(renderer: Any) -> None:
    look, edge, away = looks("<box size='0.6 0.6 0.6'/>"), 0.6, 1.5
    off = []
    for step in range(10):
        left, up = 0.003 * step, 0.0047 * step  # m; less than a pixel from one to the next
        seen = picture(renderer, (look, Pose(Point(away + edge / 2, left, HIGH + up))))
        rows, columns = np.nonzero((seen.colors[:, :, 0] > 60) & (seen.colors[:, :, 1] < 30))
        middle = (HEIGHT - 1) / 2 - up / away * FOCAL, (WIDTH - 1) / 2 - left / away * FOCAL
        off.append((rows.mean() - middle[0], columns.mean() - middle[1]))
    assert np.abs(np.mean(off, axis=0)).max() < 0.2


def test_the_depth_of_a_tilted_wall_is_that_of_its_plane(renderer: Any) -> None:
    """Along the view, not along the ray; to the edges of the field of view."""
    turned = Quaternion(0.0, 0.0, math.sin(TILT / 2), math.cos(TILT / 2))
    seen = picture(
        renderer, (looks("<box size='0.2 20 20'/>"), Pose(Point(3.0, 0.0, HIGH), turned))
    )
    columns = np.arange(WIDTH) + 0.5
    left = (WIDTH / 2 - columns) / FOCAL  # m at a distance of 1 m
    expected = (3.0 * math.cos(TILT) - 0.1) / (math.cos(TILT) + math.sin(TILT) * left)
    for row in (0, HEIGHT // 2, HEIGHT - 1):
        assert seen.depth[row] == pytest.approx(expected, rel=0.01)


def test_the_ground_is_seen_from_below_the_nearest_plane_to_the_farthest(renderer: Any) -> None:
    """One triangle of it begins behind the camera."""
    seen = picture(renderer, ground=True)
    rows = np.arange(HEIGHT) + 0.5
    expected = HIGH * FOCAL / (rows - HEIGHT / 2)
    for row in (HEIGHT // 2 + 5, HEIGHT - 1):
        assert seen.depth[row, [0, WIDTH // 2, WIDTH - 1]] == pytest.approx(expected[row], rel=0.11)
    assert not np.isfinite(seen.depth[: HEIGHT // 2 - 1]).any()
    assert (seen.colors[0] == 255).all()


def test_only_the_outside_of_a_shape_is_seen(renderer: Any) -> None:
    seen = picture(renderer, (looks("<sphere radius='4'/>"), Pose(Point(0.0, 0.0, HIGH))))
    assert not np.isfinite(seen.depth).any()


TURNED, LYING = Quaternion(0.1, 0.2, 0.3, 0.9274), Quaternion(0.6, 0.0, 0.0, 0.8)
SCENE = (
    ("<box size='0.3 0.4 0.5'/>", "0.9 0.6 0.1 1", Pose(Point(1.5, 0.5, 0.4), TURNED)),
    ("<sphere radius='0.3'/>", "0.2 0.3 1 1", Pose(Point(2.0, -0.3, 0.6))),
    ("<cylinder radius='0.2' length='0.6'/>", "0 0.7 0.2 1", Pose(Point(1.4, 0.0, 0.3), LYING)),
)


@pytest.mark.skipif("pybullet" not in renderers(), reason="pybullet is not installed")
def test_two_renderers_take_the_same_picture() -> None:
    scene = [(looks(geometry, color), pose) for geometry, color, pose in SCENE]
    made = [kind() for kind in renderers().values()]
    one, other = (picture(renderer, *scene, ground=True) for renderer in made)
    for renderer in made:
        renderer.close()
    differs = np.abs(one.colors.astype(int) - other.colors).max(axis=2)
    assert (differs > 25).mean() < 0.03, "but for the pixels of edges"
    near = (one.depth < 5) & (other.depth < 5)
    assert near.mean() > 0.3
    assert (np.abs(one.depth[near] - other.depth[near]) > 0.1).mean() < 0.05


def test_what_is_far_too_far_or_too_thin_is_left_out(renderer: Any) -> None:
    far = Pose(Point(1e300, 0.0, 0.0))
    seen = picture(
        renderer,
        (looks("<box size='0.3 0.000001 0.5'/>"), Pose(Point(1.0))),
        (looks("<sphere radius='1'/>"), far),
    )
    assert seen.colors.shape == (HEIGHT, WIDTH, 3)
