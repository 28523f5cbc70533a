"""Foxglove's clients take turns at a robot."""

import time
from typing import Any

import pytest

from holozen.messages import JointState, Twist
from holozen.testing import Wire, wait_for
from holozen.testing.process import PATIENCE
from holozen.view import foxglove_server
from holozen.view.foxglove_server import TURN, Commands, Turns

A, B = 1, 2


def drives(turns: Turns, client: int, begin: float, end: float, robot: str = "Fred") -> list[bool]:
    """Whether each motion of a client counts that it sends at 10 Hz."""
    return [
        turns.take(robot, client, True, begin + 0.1 * each)
        for each in range(round((end - begin) * 10))
    ]


def test_what_a_client_holds_that_was_refused_moves_nothing_until_it_lets_go() -> None:
    turns = Turns()
    assert all(drives(turns, A, 0.0, 1.0))
    assert all(drives(turns, B, 0.0, 1.0, robot="Ann")), "another robot"
    assert turns.take("Fred", A, False, 1.0)
    assert not any(drives(turns, B, 1.0, 5.0))
    assert all(drives(turns, B, 5.0 + TURN, 6.0 + TURN))


def test_any_client_stops_a_robot_whose_driver_then_has_to_let_go() -> None:
    turns = Turns()
    assert all(drives(turns, A, 0.0, 1.0))
    assert turns.take("Fred", B, False, 1.0)
    assert not any(drives(turns, A, 1.1, 3.0))
    assert all(drives(turns, A, 3.0 + TURN, 4.0))


@pytest.mark.parametrize(
    "command", [b'{"name": ["a"], "position": [1.0]}', b'{"name": ["a"], "effort": [1.0]}']
)
def test_whoever_drives_a_robot_also_has_its_joints(
    wire: Wire, monkeypatch: pytest.MonkeyPatch, command: bytes
) -> None:
    monkeypatch.setattr(foxglove_server, "TURN", PATIENCE)
    sim, view = wire.bus("sim"), wire.bus("view")
    sim.subscribe("cmd_vel", Twist)
    sim.subscribe("joint_command", JointState)
    wait_for(lambda: {"cmd_vel", "joint_command"} <= {one.key for one in view.endpoints()})
    commands = Commands(view, view.endpoints)
    commands.open(A, channel("cmd_vel", Twist))
    commands.open(B, channel("joint_command", JointState))
    prompt = time.monotonic() + PATIENCE  # at any time until then
    commands.put(A, 7, b'{"linear": {"x": 0.3}}', prompt)
    with pytest.raises(ValueError, match=r"^/joint_command: somebody else drives"):
        commands.put(B, 7, command, prompt)
    commands.halt()


def channel(key: str, kind: Any) -> dict[str, Any]:
    return {"id": 7, "topic": f"/{key}", "schemaName": kind.ROS, "encoding": "json"}
