"""A sim shared by the tests of a file, and a robot that stands and obeys anybody."""

import contextlib
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
import zenoh

from holozen.testing import Process, Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.wire import COMMAND_SILENCE

from .robots import Robot

Verb = Callable[..., subprocess.CompletedProcess[str]]
Done = subprocess.CompletedProcess[str]
PATIENT = 2.0  # s
SPAWN = ("spawn", "--timeout", "30")  # s for a sim that a busy machine holds up
# what `topic pub` says of a command that was held up
LATE = re.compile("not obeyed: (late|old): ")


@pytest.fixture(scope="module")
def town() -> Iterator[Wire]:
    """A wire for all tests of a file."""
    with Wire() as wire:
        yield wire


@pytest.fixture(scope="module")
def sim(town: Wire) -> Process:
    """A sim with hb_bot at the root, for all tests of a file."""
    return start_sim(town)


@pytest.fixture(scope="module")
def only_robot(town: Wire, sim: Process) -> Robot:
    return Robot(town.bus())


@pytest.fixture
def robot(only_robot: Robot) -> Robot:
    """The file's robot: it stands, and its former drivers are forgotten."""

    def handed_over() -> bool:
        with contextlib.suppress(ServiceError):
            return bool(only_robot.resume())
        return False

    only_robot.stands()
    wait_for(handed_over, what="the robot to be handed over")
    return only_robot


@pytest.fixture
def patient(robot: Robot) -> Iterator[Robot]:
    """The file's robot, for a source that has to stay fresh on a busy machine: it stops after
    PATIENT only.
    """
    yield robot.wait_longer(PATIENT)
    robot.wait_longer(COMMAND_SILENCE)


@pytest.fixture
def verb(call: Verb) -> Verb:
    """`verb(wire, "topic", "list")`: run `holozen topic list` on a wire, in this process. As a
    process of its own each verb is tried in test_every_verb.py.
    """
    return lambda wire, *words: call(*words, *wire.flags)


def comes_to(wanted: object, look: Callable[[], object]) -> None:
    """Wait until a look gives what is wanted. One look at the graph leaves out a node that a busy
    machine does not let answer within half a second.
    """
    wait_for(lambda: look() == wanted, what=lambda: f"{wanted!r}; a look gives {look()!r}")


def in_time(command: Callable[[], Done]) -> Done:
    """What became of a command that came in time: another one, where a busy machine held it up."""
    done = wait_for(lambda: None if LATE.search((done := command()).stderr) else done)
    assert done
    return done


def start_sim(wire: Wire, *flags: str) -> Process:
    """A sim that listens."""
    sim = wire.start("sim", *flags)
    sim.wait_for_line("listens on")
    return sim


# A subscriber as Zenoh makes it by default, with a queue that blocks when it is full; it is never
# read.
DEAF = """
import sys, time, zenoh
config = zenoh.Config()
for path, value in (("mode", '"client"'), ("connect/endpoints", sys.argv[1]), ("scouting/multicast/enabled", "false")):
    config.insert_json5(path, value)
session = zenoh.open(config)  # kept: one without a reference is closed
subscriber = session.declare_subscriber(sys.argv[2])
print("deaf", flush=True)
time.sleep(3600)
"""  # noqa: E501


def deaf(wire: Wire, key: str) -> Process:
    """A foreign node that subscribes to a key and never reads."""
    process = Process([sys.executable, "-c", DEAF, json.dumps([wire.endpoint]), key])
    process.wait_for_line("deaf")
    return process


@pytest.fixture
def foreign(town: Wire) -> Iterator[zenoh.Session]:
    """A plain Zenoh session that knows nothing of holozen."""
    with zenoh.open(foreign_config(town)) as session:
        yield session


def foreign_config(wire: Wire) -> zenoh.Config:
    config = zenoh.Config()
    endpoints = json.dumps([wire.endpoint])
    for path, value in (
        ("mode", '"client"'),
        ("connect/endpoints", endpoints),
        ("scouting/multicast/enabled", "false"),
    ):
        config.insert_json5(path, value)
    return config
