"""A static mesh collides as it is: a house made of one mesh has rooms, in both engines, also after
it was sent.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from holozen.robot.files.loading import both, load, received
from holozen.robot.model import RobotModel
from services.sim.physics.concave import convex_pieces
from services.sim.physics.movers import mover_for
from services.sim.physics.world import World

Size = tuple[float, float, float]
# m; of the house, which is 4 m wide inside, with a door of 1.2 m to the east
FLOOR, HIGH = (0.1, 0.8)
DISC = """<robot name="disc"><link name="base">
<inertial><mass value="5"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial>
<collision><geometry><cylinder radius="0.3" length="0.2"/></geometry></collision></link>
<gazebo><plugin name="d" filename="libgazebo_ros_planar_move.so"/></gazebo></robot>"""


def house(folder: Path, static: bool = True) -> Path:
    """The file of a house: a floor, three walls, and one with a door, as one mesh."""
    boxes: list[tuple[Size, Size]] = [((4.4, 4.4, FLOOR), (0, 0, FLOOR / 2))]
    walls = [((4.4, 0.2), (0, 2.1)), ((4.4, 0.2), (0, -2.1)), ((0.2, 4.4), (-2.1, 0))]
    walls += [((0.2, 1.6), (2.1, 1.4)), ((0.2, 1.6), (2.1, -1.4))]
    boxes += [((x, y, HIGH), (px, py, HIGH / 2)) for (x, y), (px, py) in walls]
    parts: list[Any] = [trimesh.creation.box(size).apply_translation(at) for size, at in boxes]
    whole: Any = trimesh.util.concatenate(parts)
    whole.export(folder / "house.stl")
    (folder / "house.sdf").write_text(
        f"<sdf version='1.6'><model name='house'><static>{static}</static><link "
        "name='a'><collision name='c'><geometry>"
        "<mesh><uri>house.stl</uri></mesh></geometry></collision></link></model></sdf>"
    )
    return folder / "house.sdf"


def disc(folder: Path) -> RobotModel:
    (folder / "disc.urdf").write_text(DISC)
    return load(folder / "disc.urdf")


@pytest.mark.engines
def test_a_robot_drives_in_a_house_stops_at_a_wall_and_leaves_by_the_door(
    ground: World, tmp_path: Path
) -> None:
    mover_for(ground, received(both(house(tmp_path), {}, {}, False, ())[1]), (0.0, 0.0, 0.0))
    robot = mover_for(ground, disc(tmp_path), (0.0, 0.0, FLOOR + 0.1))
    assert ground.overlapped(robot.body) == []

    def drive(x: float, y: float, seconds: float) -> tuple[float, float, float]:
        for _ in range(round(seconds * 240)):
            robot.move((x, y, 0.0), 1 / 240)
            ground.step()
        return robot.body.pose()[0]

    # at its speed, over the floor
    assert drive(0.0, 1.0, 1.0) == pytest.approx((0, 1, FLOOR + 0.1), abs=0.01)
    assert drive(0.0, 1.0, 3.0)[1] == pytest.approx(2.0 - 0.3, abs=0.02)
    drive(0.0, -1.0, 1.7)
    x, y, z = drive(1.0, 0.0, 4.0)
    assert x > 3 and abs(y) < 0.3 and z < 0.11, "through the door, and down from the floor"


@pytest.mark.engines
def test_a_laser_sees_the_walls_from_inside(ground: World, tmp_path: Path) -> None:
    rays = ground.ray_caster()
    rays.add("house", load(house(tmp_path)))
    rays.add("disc", disc(tmp_path))
    angles = np.array([0.0, math.pi / 2, math.pi, math.atan2(0.9, 2.0)])
    ways = np.stack([np.cos(angles), np.sin(angles), np.zeros(4)], axis=1)
    ranges = rays.ranges((0.0, 0.0, 0.5), (0.0, 0.0, 0.0, 1.0), ways, 0.1, 10.0, ("disc", "base"))
    assert ranges == pytest.approx([math.inf, 2.0, 2.0, math.hypot(2.0, 0.9)], abs=0.01)
    rays.close()


def test_what_moves_and_what_is_convex_keeps_its_hull(tmp_path: Path) -> None:
    (shape,) = load(house(tmp_path)).links["a"].collisions
    assert len(np.frombuffer(shape.triangles, np.float32)) == 9 * 72
    assert len(convex_pieces(shape)) == 36  # the sides of six boxes
    (moving,) = load(house(tmp_path, static=False)).links["a"].collisions
    trimesh.creation.icosphere(subdivisions=3).export(tmp_path / "house.stl")
    (ball,) = load(tmp_path / "house.sdf").links["a"].collisions
    assert (moving.triangles, ball.triangles) == (b"", b"")
    (tmp_path / "house.sdf").write_text(
        (tmp_path / "house.sdf").read_text().replace("False", "True")
    )
    (ball,) = load(tmp_path / "house.sdf").links["a"].collisions
    assert ball.triangles == b""
