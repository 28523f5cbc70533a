"""The world as it is at the start: the world file's models, and the robots of `--robot` side by side."""

import argparse
import math
from pathlib import Path

from holozen import data
from holozen.robot.model import RobotError, RobotModel, load, planar_drive
from holozen.robot.rigid import PlacedShape, lump
from holozen.robot.rotation import matrix_of, quaternion_of
from holozen.robot.standing import lowest
from holozen.tell import say
from holozen.wire import key_for

from .engine import UPRIGHT
from .entities import Entities, EntityError

GAP = 0.5  # m between two robots at the start


def furnish(entities: Entities, models: tuple[RobotModel, ...]) -> None:
    """The models of the world file, where it puts them. Raises RobotError."""
    for model in models:
        rotation = quaternion_of(matrix_of(model.pose.rpy))
        try:
            entities.add(entities.free_name(_legal(model.name)), model, (model.pose.xyz, rotation))
        except EntityError as error:
            raise RobotError(f"model {model.name!r} of the world: {error}") from None


def spawn_all(entities: Entities, args: argparse.Namespace) -> None:
    """Every robot of `--robot` on the ground, side by side along y, the first at the origin. Raises RobotError."""
    robots: list[tuple[Path, str]] = args.robot or [(data.find("urdf", "hb_bot.urdf.xacro"), "")]
    names = [name for _, name in robots]
    for name in names:
        if names.count(name) > 1:
            raise RobotError(f"{names.count(name)} robots are called {name!r}; give each a name: --robot FILE=NAME")
    y = 0.0
    for number, (path, name) in enumerate(robots):
        model = _read(path, dict(args.package), args.drive)
        reach = max(map(_reach, lump(model).collisions), default=0.0)
        y += reach if number else 0.0
        _add(entities, path, name, model, y)
        y += reach + GAP


def _add(entities: Entities, path: Path, name: str, model: RobotModel, y: float) -> None:
    try:
        entity = entities.add(
            name or entities.free_name(_legal(model.name)), model, ((0.0, y, -lowest(model)), UPRIGHT), name
        )
    except EntityError as error:
        raise RobotError(f"{path}: {error}") from None
    drive = model.drive
    assert drive is not None, "_read refuses a robot without"
    say(f"sim: {entity.name} listens on {key_for(drive.command_topic, name)}")
    for topic, known in ((drive.command_topic, "cmd_vel"), (drive.odometry_topic, "odom")):
        if topic.rpartition("/")[2] != known:
            say(f"sim: {path}: topic {topic!r}: the teleop and the controller use {known!r}")


def _read(path: Path, packages: dict[str, Path], drive: str | None) -> RobotModel:
    """A robot's file, checked. Raises RobotError."""
    model = load(path, packages=packages)
    for warning in model.warnings:
        say(f"sim: {warning}")
    if model.drive is None and drive:
        model = planar_drive(model)
    if model.drive is None:
        raise RobotError(f"{path}: no plugin drives it; add one, or have it moved as a whole: --drive planar_move")
    if not lump(model).collisions:
        raise RobotError(f"{path}: no collision shape to stand on; give a link a <box>, <cylinder>, <sphere> or <mesh>")
    return model


def _legal(name: str) -> str:
    """A model's name as one for an entity: it may hold anything."""
    word = "".join(letter if letter.isascii() and (letter.isalnum() or letter in "_-") else "_" for letter in name)
    return word[:60] if word[:1].isalpha() else f"robot_{word}"[:60]


def _reach(part: PlacedShape) -> float:
    """How far in metres a shape may reach from the robot's z axis."""
    size = max((math.hypot(*point) for point in part.shape.points), default=math.hypot(*part.shape.size))
    return math.hypot(part.xyz[0], part.xyz[1]) + size
