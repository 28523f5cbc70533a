"""The initial world: the models of the world file, and the robots of `--robot`, side by side."""

import argparse
import math
from pathlib import Path

from msgspec.structs import replace

from holozen import data
from holozen.console import report
from holozen.entities import has_no_room
from holozen.robot.errors import RobotError
from holozen.robot.files.loading import load
from holozen.robot.model import Camera, Pushed, RobotModel, Sensor, takes
from holozen.robot.requirements import drivable, require_names
from holozen.robot.rigid import PlacedShape, lowest, lump
from holozen.rotation import from_rpy
from holozen.suggest import listed
from holozen.wire import key_for

from .entities import Entities
from .errors import EntityError
from .physics.engine import UPRIGHT
from .shard import Shard

GAP = 0.5  # m between two robots at the start


def add_models(entities: Entities, models: tuple[RobotModel, ...]) -> None:
    """Add the models of the world file at their poses. One that cannot be added is left out, with a
    line that says why.

    The sensors of one without a drive, such as a camera above an arena, are at the root, as in
    Gazebo, unless another model has their keys.
    """
    for model in models:
        place = model.pose.xyz, from_rpy(*model.pose.rpy)
        name = entities.free_name(_valid_name(model.name))
        try:
            try:
                entities.add(
                    name, model if model.drive else _at_root(model), place, may_overlap=True
                )
            except EntityError:
                entities.add(name, model, place, may_overlap=True)
        except EntityError as error:
            report(f"sim: warning: the model {model.name!r} of the world is left out: {error}")


def _at_root(model: RobotModel) -> RobotModel:
    """The model, with the keys of its sensors at the root."""
    return replace(model, sensors=tuple(map(_sensor_at_root, model.sensors)))


def _sensor_at_root(sensor: Sensor) -> Sensor:
    camera = sensor.device
    if isinstance(camera, Camera):
        keys = {
            name: f"/{key}" for name in ("image", "info", "depth") if (key := getattr(camera, name))
        }
        camera = replace(camera, **keys)
    return replace(sensor, topic=f"/{sensor.topic}", device=camera)


def spawn_all(entities: Entities, args: argparse.Namespace, mine: Shard | None = None) -> list[str]:
    """Add the robots of `--robot` on the ground, side by side along y, the first one at the origin;
    in a shard only those that belong to it. Returns on which keys each listens, as text for people.
    Raises RobotError.
    """
    robots: list[tuple[Path, str]] = args.robot or [(data.find("urdf", "hb_bot.urdf.xacro"), "")]
    read = {path: _read(path, args) for path in dict.fromkeys(path for path, _ in robots)}
    models = [read[path] for path, _ in robots]
    require_names([(model, name) for model, (_, name) in zip(models, robots, strict=True)])
    added, y = list[str](), 0.0
    for number, (model, (path, name)) in enumerate(zip(models, robots, strict=True)):
        reach = max(map(_reach, lump(model).collisions), default=0.0)
        y += reach if number else 0.0
        if not mine or mine.owns(name):
            added.append(_add(entities, path, name, model, y))
        y += reach + GAP
    return added


def _add(entities: Entities, path: Path, name: str, model: RobotModel, y: float) -> str:
    try:
        entity = entities.add(
            name or entities.free_name(_valid_name(model.name)),
            model,
            ((0.0, y, -lowest(model)), UPRIGHT),
            name,
        )
    except EntityError as error:
        advice = "; start with --empty, and `holozen spawn` it there" if has_no_room(error) else ""
        raise RobotError(f"{path}: {error}{advice}") from None
    drive = model.drive
    assert drive is not None, "_read refuses a robot without a drive"
    pushed = isinstance(drive.mechanism, Pushed)
    keys = [*([] if pushed else [drive.command_topic]), *(force.topic for force in model.forces)]
    keys = [key_for(key, name) for key in keys]
    for topic, known in ((drive.command_topic, "cmd_vel"), (drive.odometry_topic, "odom")):
        if topic.rpartition("/")[2] != known:
            how = (
                f"; `holozen teleop --cmd-vel {keys[0]}` drives it"
                if known == "cmd_vel" and not pushed
                else ""
            )
            report(
                f"sim: warning: {path}: topic {topic!r}: the teleop and the controller use "
                f"{known!r}{how}"
            )
    return f"{entity.name} listens on {listed(keys)}"


def _read(path: Path, args: argparse.Namespace) -> RobotModel:
    """Load and check a robot's file. Raises RobotError."""
    model = load(path, packages=dict(args.package), allow_env=args.allow_env)
    for warning in model.warnings:
        report(f"sim: warning: {warning}")
    if args.drive and not takes(model, args.drive):
        report(
            f"sim: warning: {path}: has a drive of its own, which is used; --drive {args.drive} "
            "is not"
        )
    return drivable(model, path, args.drive)


def _valid_name(name: str) -> str:
    """A valid entity name from a model's name, which may hold any character."""
    word = "".join(
        letter if letter.isascii() and (letter.isalnum() or letter in "_-") else "_"
        for letter in name
    )
    return word[:60] if word[:1].isalpha() else f"robot_{word}"[:60]


def _reach(part: PlacedShape) -> float:
    """An upper bound (m) of how far a shape extends from the robot's z axis."""
    size = max(
        (math.hypot(*point) for point in part.shape.points), default=math.hypot(*part.shape.size)
    )
    return math.hypot(part.xyz[0], part.xyz[1]) + size
