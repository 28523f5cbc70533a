"""The client side of the sims' services: list, locate, spawn and delete robots and objects; pause, step and reset.

Several sims may run on one wire, of which one spawns. Requests about entities go to all of them.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from holozen.bus import Bus
from holozen.messages import Message, Pose, PoseStamped, RobotDescriptionReply, RobotDescriptionRequest
from holozen.messages import simulation_interfaces as si
from holozen.transport.errors import NoReply, ServiceError

NOTICE = 3.0  # s for a sim to answer
PATIENCE = 30.0  # s for a request to complete
AT_ONCE = 32  # requests of `for_each` that wait at the sim

T = TypeVar("T")
U = TypeVar("U")
R = TypeVar(
    "R",
    si.SpawnEntityReply,
    si.DeleteEntityReply,
    si.GetEntityStateReply,
    si.GetEntitiesReply,
    si.GetSimulationStateReply,
)


def names(bus: Bus, notice: float = 0.0) -> list[str]:
    """The names of all entities, sorted. Raises ServiceError, also if no sim answers within `notice` seconds (3)."""
    replies = ask_sims(bus, "get_entities", si.GetEntitiesRequest(), si.GetEntitiesReply, notice)
    return sorted({name for reply in replies for name in reply.entities})


def ask_sims(bus: Bus, key: str, request: Message, reply: type[R], notice: float = 0.0) -> list[R]:
    """The good replies of all sims. Raises ServiceError, also if no sim answers within `notice` seconds (3)."""
    notice = notice or NOTICE
    bus.endpoints()  # once they are known, all sims are connected
    try:
        return _ask(bus, key, request, reply, notice)
    except NoReply:
        raise ServiceError(f"no sim answered within {notice:g} s; start one in another terminal: holozen sim") from None


def pose(bus: Bus, name: str) -> Pose:
    """The pose of an entity in the world. Raises ServiceError."""
    return _ask(bus, "get_entity_state", si.GetEntityStateRequest(name), si.GetEntityStateReply, PATIENCE)[0].state.pose


def delete(bus: Bus, name: str) -> None:
    """Delete an entity. Raises ServiceError."""
    _ask(bus, "delete_entity", si.DeleteEntityRequest(name), si.DeleteEntityReply, PATIENCE)


def description(bus: Bus, name: str, number: int, timeout: float) -> RobotDescriptionReply | None:
    """What the entity of this name and number looks like; None if it is not there now. Raises ServiceError."""
    replies = bus.call_all("robot_description", RobotDescriptionRequest(name), RobotDescriptionReply, timeout)
    return next((reply for reply in replies if reply.number == number), None)


def set_playing(bus: Bus, playing: bool) -> list[str]:
    """Let the time of all sims pass, or pause it. Returns the sims' warnings. Raises ServiceError."""
    state = si.SimulationState.STATE_PLAYING if playing else si.SimulationState.STATE_PAUSED
    request = si.SetSimulationStateRequest(si.SimulationState(state))
    return _control(bus, "set_simulation_state", request, si.SetSimulationStateReply)


def step(bus: Bus, steps: int, timeout: float = 0.0) -> list[str]:
    """Let all sims, which are paused, make so many steps, for which they may take `timeout` seconds more than for
    others. Returns their warnings. Raises ServiceError.
    """
    return _control(bus, "step_simulation", si.StepSimulationRequest(steps), si.StepSimulationReply, timeout)


def reset(bus: Bus, scope: int = si.ResetSimulationRequest.SCOPE_DEFAULT) -> list[str]:
    """Put all sims back to their start. Returns their warnings. Raises ServiceError."""
    return _control(bus, "reset_simulation", si.ResetSimulationRequest(scope), si.ResetSimulationReply)


def spawn(bus: Bus, name: str, text: str, at: Pose, namespace: str = "") -> tuple[str, list[str]]:
    """Spawn a robot or object from URDF or SDF text. Returns its name in the world, and the sim's warnings about the
    text. Raises ServiceError.

    Its keys are below `namespace`: by default its name; a slash means the root.
    """
    place = PoseStamped(pose=at)
    request = si.SpawnEntityRequest(name, resource_string=text, entity_namespace=namespace, initial_pose=place)
    (reply,) = _ask(bus, "spawn_entity", request, si.SpawnEntityReply, PATIENCE, everyone=False)
    return reply.entity_name or name, reply.result.error_message.splitlines()


def for_each(ask: Callable[[T], U], items: Iterable[T]) -> Iterator[U]:
    """`ask` each item, many at a time, since a sim reads requests every 20 ms only. The results in order; raises the
    first error, after which what is under way is not waited for.
    """
    from concurrent.futures import ThreadPoolExecutor

    pool = ThreadPoolExecutor(AT_ONCE)
    try:
        yield from pool.map(ask, items)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def is_taken(error: ServiceError) -> bool:
    """Whether a spawn failed only because its name is taken."""
    return _code(error) == si.SpawnEntityReply.NAME_NOT_UNIQUE


def has_no_room(error: ServiceError) -> bool:
    """Whether a spawn failed because something else is at its place."""
    return _code(error) == si.SpawnEntityReply.INVALID_POSE


def _control(bus: Bus, key: str, request: Message, reply: type[Any], more: float = 0.0) -> list[str]:
    """Ask all sims, which may take `more` seconds, and return their warnings."""
    ask_sims(bus, "get_simulation_state", si.GetSimulationStateRequest(), si.GetSimulationStateReply)
    answers = bus.call_all(key, request, reply, PATIENCE + more)
    return [warning for answer in answers if (warning := answer.result.error_message)]


def _code(error: ServiceError) -> object:
    result = error.fields.get("result")
    return result.get("result") if isinstance(result, dict) else None


def _ask(bus: Bus, key: str, request: Message, reply: type[R], timeout: float, everyone: bool = True) -> list[R]:
    answers = bus.call_all(key, request, reply, timeout) if everyone else [bus.call(key, request, reply, timeout)]
    good = [answer for answer in answers if answer.result.result == si.Result.OK]
    if not good:  # our sim sends an error reply instead; others may not
        result = answers[0].result
        raise ServiceError(result.error_message or f"{key} failed with result {result.result}")
    return good
