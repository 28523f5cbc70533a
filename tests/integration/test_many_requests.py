"""Many requests at once: each gets its answer or the word busy, and a stop goes before all of
them.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import pytest

from holozen import entities
from holozen.bus import Bus
from holozen.messages import Pose, TriggerReply, TriggerRequest
from holozen.robot.files.xacro import expand_xacro
from holozen.testing import Wire, wait_for
from holozen.transport.connection import Connection
from holozen.transport.errors import TIMEOUT
from holozen.transport.samples import Replies, Sample
from holozen.transport.services import refusal

from .conftest import start_sim
from .robots import URDF, Robot, moves, rests

MANY = 1000
PATIENCE = 30.0  # s


@pytest.fixture(scope="module")
def sim(town: Wire) -> None:
    start_sim(town, "--robot", str(URDF / "hb_bot.urdf.xacro"))


@pytest.fixture(scope="module")
def crowd(town: Wire, sim: None) -> Iterator[list[Bus]]:
    """Twenty nodes; clients of the sim, for as many peers would talk to each other most of the
    time.
    """
    at_the_sim = Connection(mode="client", connect=(town.endpoint,))
    with ExitStack() as ends:
        crowd = [ends.enter_context(Bus(f"caller{number}", at_the_sim)) for number in range(20)]
        for bus in crowd:
            wait_for(bus.served("spawn_entity"))
        yield crowd


@pytest.fixture
def released(robot: Robot) -> Iterator[Robot]:
    yield robot
    robot.bus.call("release", TriggerRequest(), TriggerReply)


def ask(callers: list[Bus], key: str) -> list[Replies]:
    return [callers[number % len(callers)].ask(key, PATIENCE) for number in range(MANY)]


def outcomes(asked: list[Replies]) -> set[str]:
    """What became of requests."""
    return {outcome(list(replies)) for replies in asked}


def outcome(replies: list[Sample | bytes]) -> str:
    if len(replies) != 1 or replies[0] == TIMEOUT:
        return "not answered"
    (reply,) = replies
    return "busy" if isinstance(reply, bytes) and refusal(reply).fields.get("busy") else "answered"


def test_every_request_of_a_thousand_is_answered(robot: Robot, crowd: list[Bus]) -> None:
    assert outcomes(ask(crowd, "get_entities")) <= {"answered", "busy"}


def test_a_flood_of_requests_holds_up_no_spawn_and_no_delete_of_others(
    robot: Robot, crowd: list[Bus]
) -> None:
    at = Pose()
    at.position.y = 3.0
    urdf = expand_xacro(URDF / "hb_bot.urdf.xacro")
    asked = [
        ask(crowd[:1], key)
        for key in ("get_entities", "get_entity_state", "spawn_entity", "delete_entity")
    ]
    entities.spawn(robot.bus, "Fred", urdf, at)
    asked.append(ask(crowd[:1], "delete_entity"))
    entities.delete(robot.bus, "Fred")
    for replies in asked:
        assert "not answered" not in outcomes(replies)


def test_a_stop_in_a_flood_of_requests_stands_at_once_and_stays(
    released: Robot, crowd: list[Bus]
) -> None:
    robot = released
    robot.wait_longer(2.0)
    robot.drive(x=0.3, until=lambda odom: moves(odom, 0.3, 0, 0))
    with ThreadPoolExecutor() as pool:
        floods = [
            pool.submit(ask, crowd[1:], key)
            for key in ("get_entities", "release", "resume", "stop")
        ]
        assert robot.bus.call("stop", TriggerRequest(), TriggerReply).success
        asked = [replies for flood in floods for replies in flood.result()]
    robot.odom.next(rests)
    for replies in asked:
        list(replies)
    assert robot.bus.call("stop", TriggerRequest(), TriggerReply).success
