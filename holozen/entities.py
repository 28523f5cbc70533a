"""The client side of the sims' services: list, locate, spawn and delete robots and objects; pause,
step and reset.

Several sims may run on one wire, of which one spawns. Requests about entities go to all of them.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from holozen.background import background
from holozen.bus import Bus
from holozen.messages import (
    Message,
    Pose,
    PoseStamped,
    RobotDescriptionReply,
    RobotDescriptionRequest,
    SimulationStatus,
)
from holozen.messages import simulation_interfaces as si
from holozen.messages.action_msgs import CancelGoalReply, CancelGoalRequest, GoalInfo
from holozen.messages.codec import CodecError, decode
from holozen.messages.unique_identifier_msgs import UUID
from holozen.suggest import listed
from holozen.transport.actions import CANCEL, RESULT, SEND, State, key_of, new_id
from holozen.transport.errors import NoReply, ServiceError
from holozen.transport.graph import SIMS, Endpoint, on_key

NOTICE = 3.0  # s for a sim to answer
PATIENCE = 30.0  # s for a request to complete
AT_ONCE = 32  # requests of `for_each` in flight
STEPS = "simulate_steps"  # the action
CANCEL_LIMIT = 5.0  # s for steps to end that are cancelled
AGAIN = 0.5  # s between two requests to cancel them
POLL = 0.01  # s
NONE_MADE = "no step was made"

DONE = "the others have done it"
HANGS = "it hangs or is stopped (fg or kill -CONT continues it), or cannot be reached from here"

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
    """The names of all entities, sorted. Raises ServiceError, also if no sim answers within
    `notice` s (0: 3 s).
    """
    return sorted({name for names in names_by_sim(bus, notice) for name in names})


def names_by_sim(bus: Bus, notice: float) -> list[list[str]]:
    """For each sim the names of its entities. Raises ServiceError, also if none answers within
    `notice` s (0: 3 s).
    """
    replies = ask_sims(bus, "get_entities", si.GetEntitiesRequest(), si.GetEntitiesReply, notice)
    return [reply.entities for reply in replies]


def ask_sims(bus: Bus, key: str, request: Message, reply: type[R], notice: float = 0.0) -> list[R]:
    """The good replies of all sims. Raises ServiceError, also if no sim answers within `notice` s
    (0: 3 s).
    """
    notice = notice or NOTICE
    bus.endpoints()  # once they are known, all sims are connected
    try:
        return _ask(bus, key, request, reply, notice)
    except NoReply:
        where = f" at {bus.where}" if bus.connected() else f": no nodes found at {bus.where}"
        raise ServiceError(
            f"no sim answered within {notice:g} s{where}; start one in another terminal: holozen "
            "sim"
        ) from None


def pose(bus: Bus, name: str) -> Pose:
    """The pose of an entity in the world. Raises ServiceError."""
    return _ask(
        bus, "get_entity_state", si.GetEntityStateRequest(name), si.GetEntityStateReply, PATIENCE
    )[0].state.pose


def delete(bus: Bus, name: str) -> None:
    """Delete an entity. Raises ServiceError."""
    _ask(bus, "delete_entity", si.DeleteEntityRequest(name), si.DeleteEntityReply, PATIENCE)


def description(bus: Bus, name: str, number: int, timeout: float) -> RobotDescriptionReply | None:
    """What the entity of this name and number looks like; None if it is not there now. Raises
    ServiceError.
    """
    replies = bus.call_all(
        "robot_description", RobotDescriptionRequest(name), RobotDescriptionReply, timeout
    )
    return next((reply for reply in replies if reply.number == number), None)


def set_playing(bus: Bus, playing: bool) -> list[str]:
    """Resume or pause all sims. Returns their warnings. Raises ServiceError."""
    state = si.SimulationState.STATE_PLAYING if playing else si.SimulationState.STATE_PAUSED
    request = si.SetSimulationStateRequest(si.SimulationState(state))
    return _control(bus, "set_simulation_state", request, si.SetSimulationStateReply)


def is_paused(bus: Bus, endpoints: Iterable[Endpoint]) -> bool:
    """Whether any of the sims with these endpoints is paused. What does not answer is not."""
    for sample in bus.last_messages(on_key(endpoints, "simulation_status", "pub")):
        with contextlib.suppress(CodecError):
            status = decode(sample.payload, sample.encoding, (SimulationStatus,), tolerant=True)
            if status.state == si.SimulationState.STATE_PAUSED:
                return True
    return False


def step(bus: Bus, steps: int) -> list[str]:
    """Let all sims, which must be paused, make `steps` steps. Returns their warnings. Raises
    ServiceError.
    """
    return _control(bus, "step_simulation", si.StepSimulationRequest(steps), si.StepSimulationReply)


def step_until(bus: Bus, steps: int, timeout: float, stop: threading.Event) -> str:
    """Let all sims, which must be paused, make `steps` steps, until `stop` is set or `timeout` s
    have passed; then the steps end. Returns why and how early they ended, or "" if all were made.
    Raises ServiceError, also if it is not certain that they have ended.
    """
    if stop.is_set():
        return NONE_MADE
    made = Stepping(bus, steps, timeout)
    outcome, deadline = background(made.run), time.monotonic() + timeout
    while not made.ended.is_set() and not stop.is_set() and time.monotonic() < deadline:
        stop.wait(POLL)
    if not made.ended.is_set():
        made.cancel()
    return outcome()


class Stepping:
    """The steps of all sims as goals of `simulate_steps`, which have one id and can be
    cancelled.
    """

    def __init__(self, bus: Bus, steps: int, timeout: float) -> None:
        self._bus, self._steps, self._timeout = bus, steps, timeout
        self._goal = UUID(list(new_id()))
        self._is_cancelled = False
        self.ended = threading.Event()

    def run(self) -> str:
        """Make them. Returns why they ended early, or "". Raises ServiceError."""
        try:
            return self._run()
        finally:
            self.ended.set()

    def _run(self) -> str:
        ask_sims(
            self._bus,
            "get_simulation_state",
            si.GetSimulationStateRequest(),
            si.GetSimulationStateReply,
        )
        messages = si.SimulateSteps.Impl
        send, result = messages.SendGoalService, messages.GetResultService
        if self._is_cancelled:
            return NONE_MADE
        sims = len(self._bus.endpoints(SIMS))
        goal = send.Request(goal_id=self._goal, goal=si.SimulateSteps.Goal(self._steps))
        accepted = self._call(SEND, goal, send.Response, PATIENCE)
        if not all(reply.accepted for reply in accepted):
            self.cancel()
            raise ServiceError("a sim rejected the steps: it has too many goals")
        replies = self._call(
            RESULT, result.Request(goal_id=self._goal), result.Response, PATIENCE + self._timeout
        )
        early = ""
        for reply in replies:
            why = reply.result.result.error_message
            if reply.status == State.CANCELED:
                early = why
            elif reply.status != State.SUCCEEDED:
                raise ServiceError(why or "a sim was started again before it had made the steps")
        _check_that_all_did(self._bus, len(replies), sims)
        return early

    def cancel(self) -> None:
        """End the steps. Raises ServiceError if they may go on."""
        self._is_cancelled, deadline = True, time.monotonic() + CANCEL_LIMIT
        request, why = CancelGoalRequest(GoalInfo(self._goal)), "their sim does not answer"
        while time.monotonic() < deadline:
            try:
                self._call(CANCEL, request, CancelGoalReply, AGAIN)
            except ServiceError as error:
                why = str(error)
            if self.ended.wait(AGAIN):
                return
        raise ServiceError(f"the steps may go on; `holozen sim pause` ends them: {why}")

    def _call(self, part: str, request: Message, reply: type[Any], timeout: float) -> list[Any]:
        return self._bus.call_all(key_of(STEPS, part), request, reply, timeout)


def reset(bus: Bus, scope: int = si.ResetSimulationRequest.SCOPE_DEFAULT) -> list[str]:
    """Reset all sims to their start. Returns their warnings. Raises ServiceError."""
    return _control(
        bus, "reset_simulation", si.ResetSimulationRequest(scope), si.ResetSimulationReply
    )


def spawn(bus: Bus, name: str, text: str, at: Pose, namespace: str = "") -> tuple[str, list[str]]:
    """Spawn a robot or object from URDF or SDF text. Returns its name in the world, and the sim's
    warnings about the text. Raises ServiceError.

    Its keys are below `namespace`: by default its name; a slash means the root.
    """
    place = PoseStamped(pose=at)
    request = si.SpawnEntityRequest(
        name, resource_string=text, entity_namespace=namespace, initial_pose=place
    )
    (reply,) = _ask(bus, "spawn_entity", request, si.SpawnEntityReply, PATIENCE, everyone=False)
    return reply.entity_name or name, reply.result.error_message.splitlines()


def for_each(ask: Callable[[T], U], items: Iterable[T]) -> Iterator[U]:
    """The results of `ask` for each item, in order. Many run at a time, since a sim reads requests
    only every 20 ms. Raises the first error, without waiting for the requests in flight.
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


def silent_sims(bus: Bus) -> list[str]:
    """The sims that others know of, but that do not answer, with their robots: `sim@1a2b3c
    (Fred)`.
    """
    hidden = bus.hidden()
    robots = {end.session: [one for one in hidden if one.session == end.session] for end in hidden}
    return [
        f"{end.source} ({listed([robot_of(one) for one in robots[end.session] if is_stop(one)])})"
        for end in hidden
        if end.key == "get_entities"
    ]


def is_stop(end: Endpoint) -> bool:
    """Whether a service stops a robot."""
    return end.kind == "srv" and end.key.rpartition("/")[2] == "stop"


def robot_of(end: Endpoint) -> str:
    """The robot of a service, by its name."""
    return end.key.rpartition("/")[0] or "the robot at the root"


def _check_that_all_did(bus: Bus, did: int, sims: int) -> None:
    """Raise ServiceError if only `did` of so many sims did as they were asked, or one that hangs
    was not asked.
    """
    if silent := silent_sims(bus):
        raise ServiceError(f"{', '.join(silent)} did not answer, {DONE}; {HANGS}")
    if did < sims:
        raise ServiceError(f"{sims - did} of {sims} sims refused or did not answer, {DONE}")


def _control(bus: Bus, key: str, request: Message, reply: type[Any]) -> list[str]:
    """Ask all sims, and return their warnings. Raises ServiceError, also if one of them did not do
    it.
    """
    ask_sims(
        bus, "get_simulation_state", si.GetSimulationStateRequest(), si.GetSimulationStateReply
    )
    sims = len(bus.endpoints(SIMS))
    answers = bus.call_all(key, request, reply, PATIENCE)
    sims = max(sims, len(bus.endpoints(SIMS)))  # one may have been heard of since
    _check_that_all_did(bus, len(answers), sims)
    return [warning for answer in answers if (warning := answer.result.error_message)]


def _code(error: ServiceError) -> object:
    result = error.fields.get("result")
    return result.get("result") if isinstance(result, dict) else None


def _ask(
    bus: Bus, key: str, request: Message, reply: type[R], timeout: float, everyone: bool = True
) -> list[R]:
    answers = (
        bus.call_all(key, request, reply, timeout)
        if everyone
        else [bus.call(key, request, reply, timeout)]
    )
    good = [answer for answer in answers if answer.result.result == si.Result.OK]
    if not good:  # our sim sends an error reply instead; others may not
        result = answers[0].result
        raise ServiceError(result.error_message or f"{key} failed with result {result.result}")
    return good
