"""A whole system that writes CDR: another library reads what the sim publishes and drives it; JSON
drives it too.
"""

import contextlib
import math
import re
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
import zenoh
from rosbags.typesys import Stores, get_typestore

from holozen.bus import Bus
from holozen.messages import GetPoseReply, GetPoseRequest, NextGoalReply, NextGoalRequest
from holozen.testing import Process, Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.wire import TOPICS

from .conftest import foreign_config, start_sim
from .robots import Robot, moves

REPO = Path(__file__).parents[2]
STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types


@pytest.fixture(scope="module")
def only_robot() -> Iterator[tuple[Wire, Robot]]:
    with Wire() as wire:
        start_sim(wire, "--wire", "cdr", "--robot", str(REPO / "urdf" / "explorer.urdf.xacro"))
        yield wire, Robot(wire.bus())


@pytest.fixture
def robot(only_robot: tuple[Wire, Robot]) -> Iterator[Robot]:
    yield only_robot[1]
    only_robot[1].stands()


@pytest.fixture
def foreign(only_robot: tuple[Wire, Robot]) -> Iterator[zenoh.Session]:
    with zenoh.open(foreign_config(only_robot[0])) as session:
        yield session


def twist(x: float) -> bytes:
    vector, kind = TYPES["geometry_msgs/msg/Vector3"], TYPES["geometry_msgs/msg/Twist"]
    message = kind(linear=vector(x=x, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0))
    return bytes(STORE.serialize_cdr(message, "geometry_msgs/msg/Twist"))


def test_what_the_sim_publishes_is_cdr_of_the_type_of_its_topic(
    robot: Robot, foreign: zenoh.Session
) -> None:
    for row in [row for row in TOPICS if "sim" in row.writers]:
        with foreign.declare_subscriber(row.key) as subscriber:
            sample = subscriber.recv()
        assert sample
        assert str(sample.encoding) == f"application/cdr;{row.type_name}"
        (reply,) = foreign.get(row.key)
        assert reply.ok
        assert str(reply.ok.encoding) == str(sample.encoding)
        if row.type_name in TYPES:
            message = STORE.deserialize_cdr(bytes(sample.payload), row.type_name)
            assert bytes(STORE.serialize_cdr(message, row.type_name)) == bytes(sample.payload)


def test_a_command_in_cdr_drives_with_and_without_its_type(
    robot: Robot, foreign: zenoh.Session
) -> None:
    def drives(x: float, encoding: str) -> bool:
        foreign.put("cmd_vel", twist(x), encoding=encoding)
        return moves(robot.newest(), x, 0, 0)

    wait_for(partial(drives, 0.3, "application/cdr"))
    wait_for(partial(drives, 0.2, "application/cdr;geometry_msgs/msg/Twist"))


def test_the_examples_of_the_docs_run(only_robot: tuple[Wire, Robot], robot: Robot) -> None:
    drives, converts = re.findall(
        r"```python\n(.*?)```", (REPO / "docs" / "interfaces.md").read_text(), re.DOTALL
    )
    exec(converts, {})
    with Process(
        [sys.executable, "-c", drives.replace("tcp/127.0.0.1:7447", only_robot[0].endpoint)]
    ) as example:
        robot.odom.next(lambda odom: moves(odom, 0.3, 0, 0))
        assert example.wait() == 0


def test_json_still_drives(robot: Robot) -> None:
    robot.drive(0.2)


def test_services_answer_in_cdr(only_robot: tuple[Wire, Robot], robot: Robot) -> None:
    wire = only_robot[0]
    service = wire.start("pose-service", "--wire", "cdr")
    service.wait_for_line("goals from")
    goal = wire.bus("asker", wire="cdr").call("next_goal", NextGoalRequest(0), NextGoalReply)
    assert goal == NextGoalReply(1.0, 0.0, math.pi / 2, 0)
    pose = wait_for(partial(has_pose, wire.bus("json")))
    assert pose and pose.odom.child_frame_id == "footprint_link"


def has_pose(bus: Bus) -> GetPoseReply | None:
    """The pose that the pose service knows; None until it has an odom."""
    with contextlib.suppress(ServiceError):
        return bus.call("get_pose", GetPoseRequest(), GetPoseReply)
    return None
