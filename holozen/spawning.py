"""Robots and objects put into a running sim: read here, where the lines of their files are known,
and sent as text.
"""

import json
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from holozen.bus import Bus
from holozen.console import report
from holozen.robot.errors import RobotError
from holozen.transport.errors import ServiceError

if TYPE_CHECKING:
    from holozen.messages import Pose
    from holozen.robot.model import RobotModel

SUNK = 5e-3  # m; a robot that is less deep in the ground does not hop
PLUGINS = {"planar_move": "libgazebo_ros_planar_move.so", "omni": "libholozen_omni_drive.so"}
ENDS = {"</robot>": "<gazebo>{}</gazebo></robot>", "</model>": "{}</model>"}
"""The end tag of a robot in URDF and in SDF -> its replacement, with the plugin of a drive for {}.
"""


class SpawnPose(NamedTuple):
    """The pose to spawn at: metres, and radians about the world's x, y, z. None: that of the file;
    for z the height at which it stands on the ground, unless the file gives one.
    """

    x: float | None = None
    y: float | None = None
    z: float | None = None
    roll: float | None = None
    pitch: float | None = None
    yaw: float | None = None


ANYWHERE = SpawnPose()


class Candidate(NamedTuple):
    """A valid robot to spawn: its name, the text to send, and its model.

    Its keys are below `namespace`: empty for its name, a slash for the root.
    """

    name: str
    text: str
    model: "RobotModel"
    namespace: str = ""


class Spawned(NamedTuple):
    """A spawned entity: its name, the key of its commands (empty if it takes none), its pose, and
    advice.
    """

    name: str
    key: str
    pose: "Pose"
    hint: str = ""

    def __str__(self) -> str:
        at = self.pose.position
        where = (
            f"listens on {self.key}" if self.key else f"stands at {at.x:.3f} {at.y:.3f} {at.z:.3f}"
        )
        return f"{self.name} {where}{self.hint and f'; {self.hint}'}"

    def as_json(self) -> str:
        """The same as one JSON object."""
        from msgspec import to_builtins

        return json.dumps(
            {"name": self.name, "key": self.key, "pose": to_builtins(self.pose), "hint": self.hint}
        )


def spawn_file(
    bus: Bus, path: Path, name: str = "", place: SpawnPose = ANYWHERE, replace: bool = False
) -> Spawned:
    """`read` a file and `put` it into the sim."""
    return put(bus, read(path, name), place, replace)


def read(
    path: Path,
    name: str = "",
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    drive: str = "",
    strict: bool = False,
    allow_env: Collection[str] = (),
) -> Candidate:
    """Read and check a file here, where its lines are known; warnings are reported. Raises
    RobotError.
    """
    from holozen.robot.files.loading import both
    from holozen.robot.model import takes
    from holozen.robot.rigid import FALLS, falls_through
    from holozen.wire import robot_name

    model, text = both(path, args, packages, strict, allow_env)
    for warning in model.warnings:
        report(f"holozen spawn: warning: {warning}")
    try:
        name = robot_name(name or model.name)
    except ValueError as error:
        raise RobotError(f"{path}: {error}; give one with --name") from None
    if falls_through(model):
        report(f"holozen spawn: warning: {path}: {FALLS}; give a link a <collision>")
    if drive and takes(model, drive):
        return _driven(Candidate(name, text, model), drive)
    if drive:
        report(
            f"holozen spawn: warning: {path}: has a drive of its own, which is used; --drive "
            f"{drive} is not"
        )
    return Candidate(name, text, model)


def put(
    bus: Bus,
    candidate: Candidate,
    place: SpawnPose = ANYWHERE,
    replace: bool = False,
    timeout: float = 0.0,
) -> Spawned:
    """Spawn a candidate; waits up to `timeout` seconds for a sim. Raises ServiceError if the sim
    refuses.

    With `replace` an entity with that name is deleted once the sim accepts the new one, which takes
    its pose unless a `place` is given.
    """
    from holozen import entities

    exists = candidate.name in entities.names(bus, timeout)
    old = entities.pose(bus, candidate.name) if replace and exists else None
    if old and place == ANYWHERE:
        pose = _inherited_pose(candidate.model, old)
    else:
        pose = requested_pose(candidate.model, place)
    try:
        name, warnings = entities.spawn(
            bus, candidate.name, candidate.text, pose, candidate.namespace
        )
    except ServiceError as error:
        # The sim checks a robot before its name, so the old one is deleted only for a valid one.
        if entities.is_taken(error) and not exists and candidate.namespace:
            raise ServiceError(
                f"{error}; --namespace NAME (-robot_namespace NAME) gives one"
            ) from None
        if entities.is_taken(error) and not replace:
            own = "--replace takes its place, " if exists else ""
            raise ServiceError(f"{error}; {own}--name gives another") from None
        if entities.has_no_room(error):
            raise ServiceError(f"{error}; -x, -y and -z choose the place") from None
        if not old or not entities.is_taken(error):
            raise
        entities.delete(bus, candidate.name)
        name, warnings = entities.spawn(
            bus, candidate.name, candidate.text, pose, candidate.namespace
        )
    known = {_complaint(warning) for warning in candidate.model.warnings}
    for warning in warnings:
        if _complaint(warning) not in known:
            report(f"holozen spawn: warning: the sim: {warning}")
    if place.z is not None:
        _warn_if_sunk(candidate.model, pose)
    return describe(name, candidate, pose)


def _complaint(warning: str) -> str:
    """A warning without its line, and without why a mesh is replaced: the sim looks for meshes in
    other folders.
    """
    return re.sub(r"^.*?, line \d+: |( is replaced by a box).*", r"\1", warning)


def _driven(candidate: Candidate, drive: str) -> Candidate:
    """The candidate, with the plugin of a drive added."""
    from holozen.robot.model import driven

    end = next(end for end in ENDS if end in candidate.text)
    head, _, tail = candidate.text.rpartition(end)
    plugin = f'<plugin name="{drive}" filename="{PLUGINS[drive]}"/>'
    return Candidate(
        candidate.name, f"{head}{ENDS[end].format(plugin)}{tail}", driven(candidate.model, drive)
    )


def requested_pose(model: "RobotModel", place: SpawnPose) -> "Pose":
    """The requested pose, else that of the file; on the ground unless either gives a height."""
    from holozen.messages import Pose
    from holozen.robot.rigid import lowest
    from holozen.rotation import from_rpy

    own = (*model.pose.xyz, *model.pose.rpy)
    x, y, z, roll, pitch, yaw = (
        mine if given is None else given for given, mine in zip(place, own, strict=True)
    )
    if place.z is None and z == 0:
        z = -lowest(model, (roll, pitch, yaw))
    return Pose.of((x, y, z), from_rpy(roll, pitch, yaw))


def _warn_if_sunk(model: "RobotModel", pose: "Pose") -> None:
    """Report a robot that was spawned in the ground, which the sim allows while its root frame is
    on it.
    """
    from holozen.robot.rigid import lowest
    from holozen.rotation import Transform, to_rpy

    at = Transform.of(pose.position, pose.orientation)
    depth = -lowest(model, to_rpy(at.rotation)) - pose.position.z
    if depth > SUNK and not model.static:
        report(
            f"holozen spawn: warning: at -z {pose.position.z:g} it is {depth:.3f} m deep in the "
            "ground, which pushes "
            "it out; without -z it stands on the ground"
        )


def _inherited_pose(model: "RobotModel", old: "Pose") -> "Pose":
    """The pose of the replaced entity, raised if the new one would intersect the ground."""
    from holozen.robot.rigid import lowest
    from holozen.rotation import Transform, to_rpy

    at = Transform.of(old.position, old.orientation)
    x, y, z = at.translation
    return old.of((x, y, max(z, -lowest(model, to_rpy(at.rotation)))), at.rotation)


def describe(name: str, candidate: Candidate, pose: "Pose") -> Spawned:
    """What was spawned under a name, with advice if nothing drives it."""
    from holozen.robot.model import MOVING
    from holozen.robot.rigid import advised_drive
    from holozen.wire import key_for

    model, prefix = candidate.model, candidate.namespace.strip("/") if candidate.namespace else name
    if model.drive is not None:
        return Spawned(name, key_for(model.drive.command_topic, prefix), pose)
    moves = any(joint.kind in MOVING for joint in model.joints.values())
    omni = (
        "--drive omni to drive its wheels, or with "
        if moves and advised_drive(model) == "omni"
        else ""
    )
    hint = (
        f"nothing drives it: spawn it with {omni}--drive planar_move to move it as a whole"
        if moves
        else ""
    )
    return Spawned(name, "", pose, hint)
