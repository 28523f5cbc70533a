"""What a client asks of the sim: which robots and objects there are, where they are, and to spawn and delete them."""

from typing import TypeVar

from holozen import simulation_interfaces as si
from holozen.bus import Bus
from holozen.errors import NoReply, ServiceError
from holozen.messages import Message, Pose

NOTICE = 3.0  # s for a sim to say that it is there
PATIENCE = 30.0  # s for all it has to do

R = TypeVar("R", si.SpawnEntityReply, si.DeleteEntityReply, si.GetEntityStateReply, si.GetEntitiesReply)


def names(bus: Bus, notice: float = 0.0) -> list[str]:
    """The names of all entities, sorted. Raises ServiceError, also when no sim is there within `notice` seconds (3)."""
    notice = notice or NOTICE
    try:
        return sorted(_ask(bus, "get_entities", si.GetEntitiesRequest(), si.GetEntitiesReply, notice).entities)
    except NoReply:
        raise ServiceError(f"no sim answered within {notice:g} s; start one in another terminal: holozen sim") from None


def pose(bus: Bus, name: str) -> Pose:
    """Where an entity is in the world. Raises ServiceError."""
    return _ask(bus, "get_entity_state", si.GetEntityStateRequest(name), si.GetEntityStateReply, PATIENCE).state.pose


def delete(bus: Bus, name: str) -> None:
    """Takes an entity out of the world. Raises ServiceError."""
    _ask(bus, "delete_entity", si.DeleteEntityRequest(name), si.DeleteEntityReply, PATIENCE)


def spawn(bus: Bus, name: str, text: str, at: Pose, namespace: str = "") -> str:
    """Puts a robot or object, URDF or SDF text, into the world; returns its name there. Raises ServiceError.

    Its keys are below `namespace`: by default its name, the root for a slash.
    """
    place = si.PoseStamped(pose=at)
    request = si.SpawnEntityRequest(name, resource_string=text, entity_namespace=namespace, initial_pose=place)
    return _ask(bus, "spawn_entity", request, si.SpawnEntityReply, PATIENCE).entity_name or name


def is_taken(error: ServiceError) -> bool:
    """Whether a spawn failed for its name alone."""
    result = error.fields.get("result")
    return isinstance(result, dict) and result.get("result") == si.NAME_NOT_UNIQUE


def _ask(bus: Bus, key: str, request: Message, reply: type[R], timeout: float) -> R:
    answer = bus.call(key, request, reply, timeout)
    result: si.Result = answer.result
    if result.result != si.OK:  # ours answers with an error reply then; others keep to the letter of the interface
        raise ServiceError(result.error_message or f"{key} failed with result {result.result}")
    return answer
