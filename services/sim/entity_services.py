"""The services of simulation_interfaces that put entities into the world, move them and take them out."""

import re
from collections.abc import Mapping
from pathlib import Path

from holozen import simulation_interfaces as si
from holozen.bus import Bus
from holozen.finite import not_finite
from holozen.graph import on_key
from holozen.messages import Header, Point, Pose, Quaternion, Time, Twist, Vector3
from holozen.robot.errors import RobotError
from holozen.robot.model import RobotModel, parse
from holozen.tell import say

from .engine import Rotation, Vector
from .entities import Entities, EntityError, Place, checked_place

FASTEST = 100.0  # m/s and rad/s that an entity may be given
ALONE = 50  # looks, about a second, after which one knows who else is there
MOST_MARKS = 20_000  # "<" in a text; reading more of them would stall the steps
WORLD = ("", "world", "odom", "map")  # frames that mean the world
_XACRO = re.compile(r"<xacro:|\$\{")  # the namespace alone may be left over from an expansion


class EntityServices:
    """Answers requests about entities. `packages` are those of `--package`: where meshes named on the wire may lie."""

    def __init__(self, bus: Bus, entities: Entities, packages: Mapping[str, Path]) -> None:
        self._entities, self._packages = entities, packages
        self._bus, self._graph, self._looks = bus, bus.graph(), 0
        serve = bus.serve
        self._servers = [
            serve("spawn_entity", si.SpawnEntityRequest, si.SpawnEntityReply, self._spawn),
            serve("delete_entity", si.DeleteEntityRequest, si.DeleteEntityReply, self._delete),
            serve("get_entities", si.GetEntitiesRequest, si.GetEntitiesReply, self._list),
            serve("get_entity_state", si.GetEntityStateRequest, si.GetEntityStateReply, self._state),
            serve("set_entity_state", si.SetEntityStateRequest, si.SetEntityStateReply, self._put),
        ]

    def answer(self) -> None:
        """Answer what waits, of each kind one request: many at once must not stall the steps."""
        for server in self._servers:
            server.answer_pending(most=1)
        self._looks += 1
        if self._looks == ALONE:
            self._tell_of_others()

    def _tell_of_others(self) -> None:
        others = on_key(self._graph.endpoints(), "spawn_entity", "srv")
        if any(other.session != self._bus.id for other in others):
            say("sim: another sim answers spawn_entity here too; what is spawned goes to either: end one of them")

    def _spawn(self, request: si.SpawnEntityRequest) -> si.SpawnEntityReply:
        model = self._read(request)
        name = request.name or model.name
        if request.allow_renaming or not request.name:
            name = self._entities.free_name(name)
        place = _place(request.initial_pose.header, request.initial_pose.pose)
        namespace = request.entity_namespace  # a slash alone is the root
        entity = self._entities.add(name, model, place, namespace.strip("/") if namespace else None)
        for warning in model.warnings:
            say(f"sim: {name}: {warning}")
        say(f"sim: {name} was put into the world")
        return si.SpawnEntityReply(entity_name=entity.name)

    def _read(self, request: si.SpawnEntityRequest) -> RobotModel:
        """The robot of a request. Nothing in it is evaluated, and no file is opened but those of known packages."""
        text = request.resource_string
        if not text:
            problem = "resource_string is empty; it holds the URDF or SDF text, as `holozen spawn FILE` sends it"
            raise EntityError(si.UNSUPPORTED_ASSETS if request.uri else si.NO_RESOURCE, problem)
        if text.count("<") > MOST_MARKS:
            problem = f"resource_string has more than {MOST_MARKS // 2} elements; a robot has at most as many"
            raise EntityError(si.RESOURCE_PARSE_ERROR, problem)
        if _XACRO.search(text):
            raise EntityError(si.UNSUPPORTED_FORMAT, "resource_string is xacro; expand it first: `holozen xacro FILE`")
        try:
            return parse(text, Path("resource_string"), self._packages, confined=True)
        except RobotError as error:
            raise EntityError(si.RESOURCE_PARSE_ERROR, str(error)) from None

    def _delete(self, request: si.DeleteEntityRequest) -> si.DeleteEntityReply:
        self._entities.remove(request.entity)
        say(f"sim: {request.entity} was taken out of the world")
        return si.DeleteEntityReply()

    def _list(self, request: si.GetEntitiesRequest) -> si.GetEntitiesReply:
        filters = request.filters
        if filters.categories or filters.tags.tags or filters.bounds.type:
            raise EntityError(si.FEATURE_UNSUPPORTED, "entities are filtered by name only: filters.filter")
        if len(filters.filter) > 100:
            raise EntityError(si.OPERATION_FAILED, "filters.filter is longer than 100 characters")
        names = [entity.name for entity in self._entities]
        return si.GetEntitiesReply(entities=_matching(names, filters.filter))

    def _state(self, request: si.GetEntityStateRequest) -> si.GetEntityStateReply:
        body = self._entities.named(request.entity).body
        position, rotation = body.pose()
        linear, angular = body.twist()
        header = Header(Time.of(self._entities.time), "world")
        state = si.EntityState(
            header, Pose(Point(*position), Quaternion(*rotation)), Twist(Vector3(*linear), Vector3(*angular))
        )
        return si.GetEntityStateReply(state=state)

    def _put(self, request: si.SetEntityStateRequest) -> si.SetEntityStateReply:
        entity, state = self._entities.named(request.entity), request.state
        position, rotation = _place(state.header, state.pose)
        linear, angular = _vector(state.twist.linear), _vector(state.twist.angular)
        if not_finite(state.twist) or max(map(abs, (*linear, *angular))) > FASTEST:
            raise EntityError(si.OPERATION_FAILED, f"twist {linear}, {angular}: use at most {FASTEST:g} m/s and rad/s")
        if entity.model.static and any((*linear, *angular)):
            raise EntityError(si.OPERATION_FAILED, f"{request.entity!r} is static; it has no velocity")
        entity.body.put(position, rotation, linear, angular)
        return si.SetEntityStateReply()


def _matching(names: list[str], wanted: str) -> list[str]:
    """The names in which a pattern is found. Only `*`, `.`, `|`, `^`, `$` and words: others can take for ever."""
    if not re.fullmatch(r"[\w.*|^$-]*", wanted) or "**" in wanted or wanted.count("*") > 3:
        raise EntityError(
            si.FEATURE_UNSUPPORTED, f"filter {wanted!r}: use letters, digits, '_', '-', '.', '*', '|', '^', '$'"
        )
    try:
        pattern = re.compile(wanted)
    except re.error as error:
        raise EntityError(si.OPERATION_FAILED, f"filter {wanted!r}: {error}") from None
    return [name for name in names if pattern.search(name)]


def _place(header: Header, pose: Pose) -> Place:
    if header.frame_id not in WORLD:
        raise EntityError(si.INVALID_POSE, f"frame {header.frame_id[:80]!r}: give the pose in the frame 'world'")
    q = pose.orientation
    rotation: Rotation = (q.x, q.y, q.z, q.w)
    return checked_place((pose.position.x, pose.position.y, pose.position.z), rotation)


def _vector(v: Vector3) -> Vector:
    return v.x, v.y, v.z
