"""The pose service hands out goals and poses of robots; every wrong request gets a reason."""

import contextlib
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zenoh

from holozen import data
from holozen.messages import GetPoseReply, GetPoseRequest, NextGoalReply, NextGoalRequest
from holozen.testing import Wire, wait_for
from holozen.transport.errors import ServiceError

from .conftest import Verb, foreign_config, start_sim
from .processes import assert_one_line
from .robots import Robot, place, time_of

HALF = math.sqrt(3) / 2
PI = math.pi

# Corners in metres for a size of 2, from the second on: it begins at the origin and ends there.
HEXAGON = [(2, 0), (3, 2 * HALF), (2, 4 * HALF), (0, 4 * HALF), (-1, 2 * HALF), (0, 0)]


def start(wire: Wire, *flags: str) -> None:
    wire.start("pose-service", *flags).wait_for_line("goals from")


@pytest.fixture(scope="module")
def service(town: Wire) -> Any:
    """A pose service with a square of 1 m: ask it for a goal by number."""
    start(town)
    bus = town.bus("asker")
    return lambda number: bus.call("next_goal", NextGoalRequest(number), NextGoalReply)


def ask(session: zenoh.Session, selector: str, payload: bytes | None = None) -> tuple[Any, Any]:
    """The one reply to a plain `get`: its value, or its error."""
    (reply,) = session.get(selector, payload=payload, timeout=10)
    answer = reply.ok or reply.err
    assert answer and str(answer.encoding) == "application/json"
    value = json.loads(bytes(answer.payload))
    return (value, None) if reply.ok else (None, value)


def test_every_goal_of_a_shape_is_a_corner_and_looks_at_the_next(wire: Wire) -> None:
    """Of the others: tests/core/pose_service/test_shapes.py."""
    start(wire, "--shape", "hexagon", "--size", "2")
    bus, corners = wire.bus(), HEXAGON
    goals = [bus.call("next_goal", NextGoalRequest(i), NextGoalReply) for i in range(len(corners))]
    for goal, corner, ahead in zip(goals, corners, corners[1:] + corners[:1], strict=True):
        assert (goal.x_goal, goal.y_goal) == pytest.approx(corner, abs=1e-9)
        look = math.atan2(ahead[1] - corner[1], ahead[0] - corner[0])
        assert math.remainder(goal.theta_goal - look, math.tau) == pytest.approx(0, abs=1e-6)
    assert [goal.end_of_list for goal in goals] == [0] * (len(corners) - 1) + [1]
    with pytest.raises(
        ServiceError, match=f"goal {len(corners)}: the list holds goals 0 to {len(corners) - 1}"
    ):
        bus.call("next_goal", NextGoalRequest(len(corners)), NextGoalReply)


def test_past_either_end_of_the_list_there_is_a_reason(service: Any) -> None:
    for number in (4, 5, -1, -4, 2**63 - 1, -(2**63)):
        with pytest.raises(ServiceError, match=f"^goal {number}: the list holds goals 0 to 3$"):
            service(number)
        assert service(0).x_goal == 1


def test_a_foreign_node_asks_by_the_selector(
    town: Wire, service: Any, foreign: zenoh.Session
) -> None:
    ok, _ = ask(foreign, "next_goal?request_goal=1")
    assert ok == {"x_goal": 1, "y_goal": 1, "theta_goal": pytest.approx(PI), "end_of_list": 0}


def test_a_wrong_request_gets_an_error_reply_and_the_service_goes_on(
    town: Wire, service: Any, foreign: zenoh.Session
) -> None:
    for selector, payload, reason in [
        ("next_goal?request_goal=9", None, "goal 9: the list holds goals 0 to 3"),
        (
            "next_goal?request_goal=one",
            None,
            "not a NextGoalRequest: Expected `int`, got `str` - at `$.request_goal`",
        ),
        ("next_goal?goal=1", None, "not a NextGoalRequest: Object contains unknown field `goal`"),
        (
            "next_goal",
            b'{"request_goal":1.5}',
            "not a NextGoalRequest: Expected `int`, got `float`",
        ),
        (
            "next_goal",
            b'{"request":1}',
            "not a NextGoalRequest: Object contains unknown field `request`",
        ),
        ("next_goal", b"{", "not a NextGoalRequest: "),
        ("next_goal", b"[" * 50_000, "not a NextGoalRequest: "),
        (
            "next_goal",
            b'{"request_goal":99999999999999999999999}',
            "goal 99999999999999999999999: the list",
        ),
        ("next_goal", b" " * 5_000_001, "request of 5000001 bytes; at most 5000000 are read"),
        ("get_pose", b'{"name":"nobody"}', "no nobody/odom was received; robots with odom: none"),
        ("get_pose", b'{"name":"a/b"}', "robot name 'a/b': use a letter, then"),
        ("get_pose", b'{"name":"**"}', "robot name '**': use a letter, then"),
    ]:
        ok, error = ask(foreign, selector, payload)
        assert ok is None
        assert error["error"].startswith(reason)
        assert service(2).y_goal == 1


def test_goals_from_a_file_are_handed_out_as_they_stand(wire: Wire, tmp_path: Path) -> None:
    (tmp_path / "goals.txt").write_text(
        "# x y theta\n1.5 -2 0.5\n\n3, 4   # looks along x\n-1e-3,0,-3.1\n"
    )
    start(wire, "--goals", str(tmp_path / "goals.txt"))
    bus = wire.bus()
    goals = [bus.call("next_goal", NextGoalRequest(i), NextGoalReply) for i in range(3)]
    assert [(g.x_goal, g.y_goal, g.theta_goal, g.end_of_list) for g in goals] == [
        (1.5, -2, 0.5, 0),
        (3, 4, 0, 0),
        (-1e-3, 0, -3.1, 1),
    ]


def test_goals_or_flags_that_are_wrong_are_one_error_line(
    verb: Verb, town: Wire, tmp_path: Path
) -> None:
    file = tmp_path / "goals.txt"
    for content, reason in (
        (b"", "no goals"),
        (b"1 2 3\n1 two 3\n", "goals.txt:2: '1 two 3'; write x y theta"),
        (b"0 inf\n", "goals.txt:1: "),
        (b"\xff\xfe1", "goals.txt: "),
    ):
        file.write_bytes(content)
        assert_one_line(verb(town, "pose-service", "--goals", str(file)), 1, reason)
    assert_one_line(verb(town, "pose-service", "--goals", "/"), 1, "goals /: ")
    size = "'0': use a number from 0.01 to 1000 m"
    assert_one_line(verb(town, "pose-service", "--size", "0"), 2, size)


def test_get_pose_returns_the_last_odom_until_it_is_stale(wire: Wire) -> None:
    """From no robot at all, through a sim that runs, to one that was killed and started again."""
    start(wire, "--shape", "square")
    bus = wire.bus()

    def pose(name: str = "") -> GetPoseReply:
        return bus.call("get_pose", GetPoseRequest(name), GetPoseReply)

    def fails(reason: str) -> bool:
        try:
            pose()
        except ServiceError as error:
            return reason in str(error)
        return False

    def has(wanted: Callable[[GetPoseReply], bool]) -> bool:
        """Whether a pose is as wanted; on a busy machine odom is stale now and then."""
        with contextlib.suppress(ServiceError):
            return wanted(pose())
        return False

    assert fails("no odom was received; robots with odom: none")
    sim = start_sim(wire)
    robot = Robot(bus)
    robot.drive(0, 0.3)
    before = robot.stop()
    there = pytest.approx(place(before), abs=1e-3)
    wait_for(
        lambda: has(
            lambda pose: time_of(pose.odom) >= time_of(before) and there == place(pose.odom)
        )
    )
    wait_for(
        lambda: has(lambda pose: 0 <= pose.age < 0.2), what="the age of an odom that just came"
    )
    with pytest.raises(
        ServiceError, match=r"^no Fred/odom was received; robots with odom: '' \(at the root\)$"
    ):
        pose("Fred")
    sim.kill()
    wait_for(lambda: fails("odom is stale: the last one came "))
    start_sim(wire)
    wait_for(lambda: not fails(""))


def test_get_pose_knows_robots_by_name(wire: Wire) -> None:
    start(wire)
    start_sim(wire, "--robot", f"{data.find('urdf', 'hb_bot.urdf.xacro')}=Fred")
    with zenoh.open(foreign_config(wire)) as session:
        pose = wait_for(lambda: ask(session, "get_pose?name=Fred")[0])
        assert pose["odom"]["header"]["frame_id"] == "Fred/odom"
        assert ask(session, "get_pose?name=Ann")[1] == {
            "error": "no Ann/odom was received; robots with odom: Fred"
        }
