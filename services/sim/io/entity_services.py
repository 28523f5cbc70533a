"""The services of simulation_interfaces that add, list, move and delete entities."""

import hashlib
import math
import re
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from holozen.bus import Bus
from holozen.console import report
from holozen.messages import (
    GetSceneReply,
    GetSceneRequest,
    Header,
    Pose,
    RobotDescriptionReply,
    RobotDescriptionRequest,
    SceneEntity,
    Time,
    Twist,
    Vector3,
)
from holozen.messages import simulation_interfaces as si
from holozen.messages.message import not_finite
from holozen.messages.simulation_interfaces import Result
from holozen.messages.simulation_interfaces import SpawnEntityReply as Spawn
from holozen.robot.errors import RobotError
from holozen.robot.files.description import written
from holozen.robot.files.loading import received
from holozen.robot.files.xacro import uses_xacro
from holozen.robot.model import RobotModel
from holozen.rotation import XYZ, Transform
from holozen.transport.services import answer_in_turn

from ..entities import Entities
from ..entity import Entity
from ..errors import EntityError
from ..physics.body import Placement
from ..placement import checked_place
from ..shard import Share

MAX_SPEED = 100.0  # m/s and rad/s, of a state to set
# waiting requests; each takes some 20 ms, and the last one is to be answered within a caller's 5 s
MAX_SPAWNS = 64
REUSED = 2.0  # s for which a model with mesh files is reused; after that its files are read again
MAX_PARSED = 8  # texts whose models are kept, for a fleet, or a robot that is spawned again
MAX_WARNINGS = 20  # about a robot's text in a reply
MAX_TAGS = 20_000  # "<" in a text; parsing more of them would stall the steps
WORLD = ("", "world", "odom", "map")  # frames that mean the world
_OK = Result(Result.OK)


class EntityServices:
    """Answers requests about entities. `packages` are those of `--package`: the only folders from
    which meshes are read.

    Of several sims on one wire only the first one `spawns`; shards spawn each its `share`. Each sim
    answers for its own entities.
    """

    def __init__(
        self,
        bus: Bus,
        entities: Entities,
        packages: Mapping[str, Path],
        spawns: bool = True,
        share: Share | None = None,
    ) -> None:
        self._entities, self._packages, self._share = entities, packages, share
        # by hash; until when (s) a model may be reused
        self._parsed: dict[bytes, tuple[RobotModel, float]] = {}
        serve = partial(bus.serve, shared=share is not None)
        self._servers = [
            serve("delete_entity", si.DeleteEntityRequest, si.DeleteEntityReply, self.delete),
            serve("get_entities", si.GetEntitiesRequest, si.GetEntitiesReply, self.names),
            serve("get_entity_state", si.GetEntityStateRequest, si.GetEntityStateReply, self.state),
            serve("set_entity_state", si.SetEntityStateRequest, si.SetEntityStateReply, self.put),
            serve("get_scene", GetSceneRequest, GetSceneReply, self.scene),
        ]
        # From a thread of its own: a text with large meshes takes longer than a step.
        serve(
            "robot_description", RobotDescriptionRequest, RobotDescriptionReply, self.description
        ).start()
        if spawns:
            self._servers.append(
                serve(
                    "spawn_entity",
                    si.SpawnEntityRequest,
                    si.SpawnEntityReply,
                    self.spawn,
                    room=MAX_SPAWNS,
                )
            )

    def answer(self) -> bool:
        """Answer waiting requests for a short time, since many at once must not stall the steps.
        Returns whether it answered any.
        """
        return answer_in_turn(self._servers)

    def spawn(self, request: si.SpawnEntityRequest) -> si.SpawnEntityReply:
        """Add a robot or object to the world."""
        if request.name:
            self._check_share(request.name)
        model = self._read(request)
        name = request.name or model.name
        self._check_share(name)
        if request.allow_renaming or not request.name:
            name = self._entities.free_name(name, self._share.mine.owns if self._share else None)
        place = _place(request.initial_pose.header, request.initial_pose.pose)
        namespace = request.entity_namespace  # a slash alone is the root
        entity = self._entities.add(name, model, place, namespace.strip("/") if namespace else None)
        for warning in model.warnings:
            report(f"sim: warning: {name}: {warning}")
        report(f"sim: {name} was added to the world")
        return si.SpawnEntityReply(Result(Result.OK, _warned(model.warnings)), entity.name)

    def _named(self, name: str) -> Entity:
        """An entity of this sim. Each shard has all objects of the world file, and of the rest only
        its own.
        """
        if name not in self._entities:
            self._check_share(name)
        return self._entities.named(name)

    def _check_share(self, name: str) -> None:
        """Raise Elsewhere if the name belongs to another shard, and EntityError if that one does
        not run.
        """
        if self._share and (problem := self._share.refusal(name)):
            raise EntityError(Result.OPERATION_FAILED, problem)

    def _read(self, request: si.SpawnEntityRequest) -> RobotModel:
        """The model in a request. No expression in it is evaluated, and only files of known
        packages are opened.
        """
        text, now = request.resource_string, time.monotonic()
        key = hashlib.sha256(text.encode()).digest()
        model, until = self._parsed.get(key, (None, 0.0))
        if model and now < until:
            return model
        if not text:
            problem = (
                "resource_string is empty; it holds the URDF or SDF text, as `holozen spawn "
                "FILE` sends it"
            )
            raise EntityError(
                Spawn.UNSUPPORTED_ASSETS if request.uri else Spawn.NO_RESOURCE, problem
            )
        if text.count("<") > MAX_TAGS:
            problem = (
                f"resource_string has more than {MAX_TAGS // 2} elements; a robot may have no more"
            )
            raise EntityError(Spawn.RESOURCE_PARSE_ERROR, problem)
        if uses_xacro(text):
            raise EntityError(
                Spawn.UNSUPPORTED_FORMAT,
                "resource_string is xacro; expand it first: `holozen xacro FILE`",
            )
        try:
            model = received(text, self._packages)
        except RobotError as error:
            raise EntityError(Spawn.RESOURCE_PARSE_ERROR, str(error)) from None
        shapes = (
            shape for link in model.links.values() for shape in (*link.collisions, *link.visuals)
        )
        lasting = not model.warnings and not any(shape.path for shape in shapes)
        self._parsed = dict([*self._parsed.items()][1 - MAX_PARSED :])
        self._parsed[key] = model, math.inf if lasting else time.monotonic() + REUSED
        return model

    def delete(self, request: si.DeleteEntityRequest) -> si.DeleteEntityReply:
        """Remove an entity."""
        self._named(request.entity)
        self._entities.remove(request.entity)
        report(f"sim: {request.entity} was removed from the world")
        return si.DeleteEntityReply(_OK)

    def names(self, request: si.GetEntitiesRequest) -> si.GetEntitiesReply:
        """The names that match the filter."""
        filters = request.filters
        if filters.categories or filters.tags.tags or filters.bounds.type:
            raise EntityError(
                Result.FEATURE_UNSUPPORTED, "entities are filtered by name only: filters.filter"
            )
        if len(filters.filter) > 100:
            raise EntityError(
                Result.OPERATION_FAILED, "filters.filter is longer than 100 characters"
            )
        names = [entity.name for entity in self._entities]
        return si.GetEntitiesReply(_OK, entities=_matching(names, filters.filter))

    def state(self, request: si.GetEntityStateRequest) -> si.GetEntityStateReply:
        """The pose and velocity of an entity in the world."""
        body = self._named(request.entity).body
        linear, angular = body.twist()
        header = Header(Time.of(self._entities.time), "world")
        state = si.EntityState(
            header, Pose.of(*body.pose()), Twist(Vector3(*linear), Vector3(*angular))
        )
        return si.GetEntityStateReply(_OK, state=state)

    def scene(self, request: GetSceneRequest) -> GetSceneReply:
        """All entities, their keys and poses."""
        return GetSceneReply([_seen(entity, request.without_joints) for entity in self._entities])

    def description(self, request: RobotDescriptionRequest) -> RobotDescriptionReply:
        """The URDF of an entity."""
        entity = self._named(request.name)
        joints = entity.robot.telemetry.joint_names if entity.robot else []
        return RobotDescriptionReply(written(entity.model), entity.number, joints)

    def put(self, request: si.SetEntityStateRequest) -> si.SetEntityStateReply:
        """Set the pose and velocity of an entity."""
        entity, state = self._named(request.entity), request.state
        place = _place(state.header, state.pose)
        linear, angular = _vector(state.twist.linear), _vector(state.twist.angular)
        if not_finite(state.twist) or max(map(abs, (*linear, *angular))) > MAX_SPEED:
            raise EntityError(
                Result.OPERATION_FAILED,
                f"twist {linear}, {angular}: use at most {MAX_SPEED:g} m/s and rad/s",
            )
        if entity.model.static and any((*linear, *angular)):
            raise EntityError(
                Result.OPERATION_FAILED, f"{request.entity!r} is static; its velocity cannot be set"
            )
        self._entities.put(entity.name, place, linear, angular)
        return si.SetEntityStateReply(_OK)


def _seen(entity: Entity, without_joints: bool) -> SceneEntity:
    robot = entity.robot
    command = entity.identity.command_key if robot else ""
    odometry = (robot and entity.identity.odometry_key) or ""
    joints = robot.actuators.mover.states()[0] if robot and not without_joints else []
    return SceneEntity(
        entity.name, entity.number, command, odometry, Pose.of(*entity.body.pose()), joints
    )


def _warned(warnings: tuple[str, ...]) -> str:
    more = (
        [f"and {len(warnings) - MAX_WARNINGS} more warnings"]
        if len(warnings) > MAX_WARNINGS
        else []
    )
    return "\n".join(" ".join(warning.split()) for warning in [*warnings[:MAX_WARNINGS], *more])


def _matching(names: list[str], wanted: str) -> list[str]:
    """The names that a pattern matches. Only `*`, `.`, `|`, `^`, `$` are special: with others a
    match may never end.
    """
    if not re.fullmatch(r"[\w.*|^$-]*", wanted) or "**" in wanted or wanted.count("*") > 3:
        raise EntityError(
            Result.FEATURE_UNSUPPORTED,
            f"filter {wanted!r}: use letters, digits, '_', '-', '.', '*', '|', '^', '$'",
        )
    try:
        pattern = re.compile(wanted)
    except re.error as error:
        raise EntityError(Result.OPERATION_FAILED, f"filter {wanted!r}: {error}") from None
    return [name for name in names if pattern.search(name)]


def _place(header: Header, pose: Pose) -> Placement:
    if header.frame_id not in WORLD:
        raise EntityError(
            Spawn.INVALID_POSE,
            f"frame {header.frame_id[:80]!r}: give the pose in the frame 'world'",
        )
    place = Transform.of(pose.position, pose.orientation)
    return checked_place(place.translation, place.rotation)


def _vector(v: Vector3) -> XYZ:
    return v.x, v.y, v.z
