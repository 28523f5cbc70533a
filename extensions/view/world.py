"""What a page changes in the world: robots are added, moved and deleted, and the time of the sims
passes or stands.
"""

import math
from collections.abc import Callable
from pathlib import Path

from holozen import data, entities
from holozen.bus import Bus
from holozen.command.collision_monitor import TIME_BEFORE_COLLISION
from holozen.messages import Point, Pose
from holozen.messages import simulation_interfaces as si
from holozen.parameter_nodes import Nodes
from holozen.transport.errors import ServiceError

from .scene import Scene, Shown

PATIENCE = 5.0  # s for the sims to answer
STEPS = 24  # of the sim that one click makes: a tenth of a second by default
FARTHEST = 100.0  # m; a click near the horizon is no place
MONITOR = "time_before_collision"  # a parameter of each robot in a sim that sees obstacles
PARTS = ("materials", "wheels")  # files of urdf/ that are no robots

TIME: dict[str, tuple[Callable[[Bus], list[str]], str]] = {
    "pause": (lambda bus: entities.set_playing(bus, False), "the sim is paused"),
    "play": (lambda bus: entities.set_playing(bus, True), "the sim plays"),
    "step": (lambda bus: entities.step(bus, STEPS), f"the sim made {STEPS} steps"),
    "reset": (entities.reset, "the sim was reset"),
}
"""By verb: what it does to the time of the sims, and the line that reports it."""


def models() -> dict[str, Path]:
    """The robots of urdf/ that can be spawned, by name."""
    files = {
        path.name.partition(".")[0]: path for path in sorted(data.find("urdf").glob("*.xacro"))
    }
    return {name: path for name, path in files.items() if name not in PARTS}


def spawn(bus: Bus, scene: Scene, model: str) -> str:
    """Spawn one more robot of a model beside the others. Returns a line; raises ServiceError or
    RobotError.
    """
    from holozen.spawning import SpawnPose, spawn_file

    if (path := models().get(model)) is None:
        return f"there is no model {model}"
    there = entities.names(bus)
    name = next(name for number in range(1, 1002) if (name := f"{model}{number}") not in there)
    taken = [one.position for one in list(scene.shown.values())]
    free = (
        float(y)
        for y in range(1000)
        if all(math.hypot(x - 1.0, y - other) > 1.5 for x, other, _ in taken)
    )
    return str(spawn_file(bus, path, name, SpawnPose(x=1.0, y=next(free))))


def delete(bus: Bus, name: str) -> str:
    """Delete a robot. Returns a line; raises ServiceError."""
    entities.delete(bus, name)
    return f"{name} was deleted"


def put(bus: Bus, shown: Shown, x: float, y: float) -> str:
    """Put a robot at a place of the world in m, with its heading and height. Returns a line; raises
    ServiceError.
    """
    pose = Pose(Point(x, y, shown.position[2]), shown.pose.orientation)
    request = si.SetEntityStateRequest(shown.entity.name, si.EntityState(pose=pose))
    bus.call_all("set_entity_state", request, si.SetEntityStateReply, PATIENCE)
    return f"{shown.entity.name} was put at {x:.2f} {y:.2f}"


def slow_down(bus: Bus, namespace: str, on: bool) -> str:
    """Let a robot slow down near obstacles, or no longer, by the parameter of its sim. Returns a
    line; raises ServiceError or BusError.
    """
    nodes, name = Nodes(bus, PATIENCE), f"{namespace}.{MONITOR}".removeprefix(".")
    for node in nodes.sessions:
        if node.rpartition("/")[2] == "sim" and name in nodes.names(node):
            wanted = TIME_BEFORE_COLLISION if on else 0.0
            (result,) = nodes.set(nodes.only(node), {name: wanted})
            if not result.successful:
                raise ServiceError(result.reason)
            return ""  # the state shows it
    raise ServiceError(f"no sim has the parameter {name}")


def set_time(bus: Bus, verb: str) -> str:
    """Pause, play, step or reset the sims. Returns a line; raises ServiceError."""
    if verb not in TIME:
        return f"no sim can {verb}"
    act, done = TIME[verb]
    return next(iter(act(bus)), done)


def on_ground(
    origin: tuple[float, ...], direction: tuple[float, ...]
) -> tuple[float, float] | None:
    """The point (m) where a ray meets the plane z = 0; None if that is behind its origin, or far
    away.
    """
    if direction[2] >= 0 or origin[2] <= 0:
        return None
    far = -origin[2] / direction[2]
    x, y = (origin[axis] + far * direction[axis] for axis in (0, 1))
    return (x, y) if math.hypot(x, y) < FARTHEST else None
