"""Robots into the world: from their files to vehicles with keys of their own."""

import argparse
import math
from pathlib import Path

from holozen import data
from holozen.bus import Bus
from holozen.graph import Graph, on_key
from holozen.robot.model import Drive, RobotError, RobotModel, load
from holozen.robot.rigid import Body, PlacedShape, lump
from holozen.tell import say
from holozen.wire import key_for

from .arbiter import Arbiter
from .intake import Intake
from .vehicle import Vehicle
from .world import SHAPES, World

GAP = 0.5  # m between two robots at the start


def spawn_all(bus: Bus, world: World, args: argparse.Namespace) -> list[Vehicle]:
    """Every robot of `--robot`, side by side along y, the first at the origin. Raises RobotError."""
    robots: list[tuple[Path, str]] = args.robot or [(data.find("urdf", "hb_bot.urdf.xacro"), "")]
    names = [name for _, name in robots]
    for name in names:
        if names.count(name) > 1:
            raise RobotError(f"{names.count(name)} robots are called {name!r}; give each a name: --robot FILE=NAME")
    vehicles: list[Vehicle] = []
    others, y = bus.graph(), 0.0
    for path, name in robots:
        model, drive, body = _read(path, dict(args.package))
        _check_alone(others, key_for(drive.odometry_topic, name))
        reach = max(map(_reach, body.collisions))
        y += reach if vehicles else 0.0
        command = key_for(drive.command_topic, name)
        intake = Intake(command, Arbiter(drive.command_timeout), args.max_linear, args.max_angular)
        vehicles.append(Vehicle(bus, name, model, drive, world.add(body, (0.0, y, 0.0)), intake))
        say(f"sim: {name or model.name} listens on {command}")
        y += reach + GAP
    return vehicles


def _read(path: Path, packages: dict[str, Path]) -> tuple[RobotModel, Drive, Body]:
    """A robot's file, checked. Raises RobotError."""
    model = load(path, packages=packages)
    for warning in model.warnings:
        say(f"sim: {warning}")
    drive = model.drive
    if drive is None:
        raise RobotError(f"{path}: no planar_move plugin, so nothing drives it; other drives are not simulated yet")
    body = lump(model)
    _check_collisions(path, body)
    for topic, known in ((drive.command_topic, "cmd_vel"), (drive.odometry_topic, "odom")):
        if topic.rpartition("/")[2] != known:
            say(f"sim: {path}: topic {topic!r}: the teleop and the controller use {known!r}")
    return model, drive, body


def _check_alone(others: Graph, key: str) -> None:
    """Two sims on the same keys would each get the other's commands. Raises RobotError."""
    for other in on_key(others.endpoints(), key, "pub"):
        raise RobotError(
            f"{key} is published by {other.node} ({other.session[:6]}) already; end that one, or use --robot FILE=NAME"
        )


def _check_collisions(path: Path, body: Body) -> None:
    """A robot needs something that the ground can carry; collision meshes are not simulated."""
    left_out = {part.link for part in body.collisions if part.shape.kind not in SHAPES}
    if left_out:
        say(f"sim: {path}: collision meshes are left out: {', '.join(sorted(left_out))}")
    if all(part.shape.kind not in SHAPES for part in body.collisions):
        raise RobotError(f"{path}: no collision shape to stand on; give a link a <box>, <cylinder> or <sphere>")


def _reach(part: PlacedShape) -> float:
    """How far in metres a shape may reach from the robot's z axis."""
    size = 0.0 if part.shape.kind == "mesh" else math.hypot(*part.shape.size)
    return math.hypot(part.xyz[0], part.xyz[1]) + size
