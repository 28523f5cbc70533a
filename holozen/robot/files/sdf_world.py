"""SDF worlds -> physics step, gravity, real-time factor, ground and models."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from holozen.packages import is_for_ros2
from holozen.robot.files import reader
from holozen.robot.files.elements import Source, Tag
from holozen.robot.files.sdf import Includes, Piece, check_world, read_file, version_of
from holozen.robot.files.sdf_models import WORLD, Frames, models_of_world
from holozen.robot.files.uris import readable
from holozen.robot.model import GRAVITY, STEP, RobotModel, Vector, WorldSpec
from holozen.robot.rigid import Frame, link_frames

STRONGEST = 100.0  # m/s^2; ten times Earth's
# s; outside this range the physics engine is far too slow or unstable
MIN_STEP, MAX_STEP = (1e-4, 0.02)
FASTEST = 1000.0  # real-time factor
LEVEL = 1e-9  # m, and of a unit vector; tolerance for a plane to count as the ground


def load_world(path: Path, packages: Mapping[str, Path] = {}) -> WorldSpec:
    """The world in an SDF file, which is read in a process of its own. Raises RobotError naming
    file and line.
    """
    return reader.run(
        WorldSpec, path, _load_world, path, packages, readable=partial(readable, path, packages)
    )


def _load_world(path: Path, packages: Mapping[str, Path]) -> WorldSpec:
    source = Source(path, packages, for_ros2=is_for_ros2(path))
    return read_world(read_file(path, source), source)


def read_world(root: Tag, source: Source) -> WorldSpec:
    """The world in an `<sdf>`. Raises RobotError."""
    world = _world_of(root)
    includes = Includes()
    check_world(world, source, includes.warned)
    frames = Frames()
    frames.add_frames(world, WORLD)
    models = list(models_of_world(Piece(world, source, version_of(root)), frames, includes))
    step, rtf = _physics(world)
    return WorldSpec(
        name=world.attributes.get("name", "default"),
        step=step,
        gravity=_gravity(world),
        rtf=rtf,
        ground=any(is_ground(model) for model in models),
        models=tuple(model for model in models if not is_ground(model)),
        warnings=tuple(source.warnings),
    )


def is_ground(model: RobotModel) -> bool:
    """Whether the collision shapes of a model are level planes at z = 0, and nothing else."""
    shapes = [(link.name, shape) for link in model.links.values() for shape in link.collisions]
    if not shapes or any(shape.kind != "plane" for _, shape in shapes):
        return False
    links, at = link_frames(model), Frame.of(model.pose)
    planes = [at @ links[name] @ Frame.of(shape.pose) for name, shape in shapes]
    return all(_is_level(plane) for plane in planes)


def _is_level(plane: Frame) -> bool:
    up = (plane.rotation @ (0.0, 0.0, 1.0)).tolist()
    return abs(plane.xyz[2]) < LEVEL and max(abs(up[0]), abs(up[1]), abs(up[2] - 1)) < LEVEL


def _world_of(root: Tag) -> Tag:
    if root.name == "robot":
        raise root.wrong("is a robot (URDF), not a world; pass it to the simulator as --robot")
    if root.name != "sdf":
        raise root.wrong(
            "is not a world; a world file starts with <sdf version=...><world name=...>"
        )
    world = root.first("world")
    if world is None and root.first("model"):
        raise root.wrong(
            "contains a model but no <world>; add it to a running world with: holozen spawn FILE"
        )
    if world is None:
        raise root.wrong("holds no <world>")
    return world


def _physics(world: Tag) -> tuple[float, float]:
    """The step in s and the real-time factor."""
    default = [
        tag
        for tag in world.all("physics")
        if tag.attributes.get("default", "").lower() in ("1", "true")
    ]
    physics = default[0] if default else world.child("physics")
    step, rtf = physics.number("max_step_size", STEP), physics.number("real_time_factor", 1.0)
    if not MIN_STEP <= step <= MAX_STEP:
        raise (physics.first("max_step_size") or physics).wrong(
            f"is {step:g} s; use {MIN_STEP} to {MAX_STEP}"
        )
    if not 0 <= rtf <= FASTEST:
        problem = f"is {rtf:g}; use 0 (as fast as possible) to {FASTEST:g}"
        raise (physics.first("real_time_factor") or physics).wrong(problem)
    return step, rtf


def _gravity(world: Tag) -> Vector:
    old = [physics for physics in world.all("physics") if physics.first("gravity")]
    owner = next((tag for tag in (world, *old) if tag.first("gravity")), None)
    if owner is None:
        return GRAVITY
    gravity = owner.vector("gravity", GRAVITY)
    if max(map(abs, gravity)) > STRONGEST:
        problem = (
            f"is {' '.join(f'{part:g}' for part in gravity)}; use at most {STRONGEST:g} "
            "m/s^2 along each axis"
        )
        raise (owner.first("gravity") or owner).wrong(problem)
    return gravity
