"""A stopped robot stands, whatever is commanded, until it is released; and the release moves
nothing by itself.
"""

import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import zenoh

from holozen import entities
from holozen.bus import Bus
from holozen.messages import (
    CommandSource,
    CommandStatus,
    JointState,
    Message,
    Odometry,
    Pose,
    TriggerReply,
    TriggerRequest,
    Twist,
)
from holozen.robot.files.xacro import expand_xacro
from holozen.spawning import SpawnPose, spawn_file
from holozen.testing import Process, Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.transport.pubsub import Publisher
from holozen.wire import key_for

from .conftest import Verb, comes_to, start_sim
from .processes import stopped
from .robots import URDF, Robot, distance, moves, rests, speeds

PERSON, SCRIPT, AUTOPILOT = "INTERACTIVE_HIGH", "DATA", "DATA_LOW"
BOT = URDF / "hb_bot.urdf.xacro"
TAG = "<commandTopic>"
# With a watchdog of a minute, a source that has to let go is silent as long, however slow the
# machine: one that was not scheduled for half a second has let go of the others.
SLOW_BOT = expand_xacro(BOT).replace(TAG, f"<cmdTimeout>60</cmdTimeout>{TAG}")
WHEELS = ["jFL", "jFR", "jBL", "jBR"]
SLOW = 0.02  # m/s, rad/s; slower is standing, for what stands on wheels


class Flood:
    """Sources that command all the time, some eighty times a second each, while they are not
    paused.
    """

    def __init__(self, wire: Wire) -> None:
        self._wire, self._end, self.paused = wire, threading.Event(), threading.Event()
        self._threads: list[threading.Thread] = []
        self._buses: list[Bus] = []

    def add(
        self, key: str, message: Message, priority: str, node: str = "flood"
    ) -> Publisher[Message]:
        self._buses.append(self._wire.bus(node))
        publisher: Publisher[Message] = self._buses[-1].publisher(key, type(message), priority)

        def run() -> None:
            while not self._end.wait(12e-3):
                if not self.paused.is_set():
                    publisher.put(message)

        self._threads.append(threading.Thread(target=run))
        self._threads[-1].start()
        return publisher

    def close(self) -> None:
        self._end.set()
        for thread in self._threads:
            thread.join()
        for bus in self._buses:
            bus.close()


@pytest.fixture
def flood(town: Wire) -> Iterator[Flood]:
    flood = Flood(town)
    yield flood
    flood.close()


@pytest.fixture(scope="module")
def sim(town: Wire) -> Process:
    return start_sim(town, "--robot", f"{BOT}=Fred")


@pytest.fixture(scope="module")
def robots(town: Wire, sim: Process) -> dict[str, Robot]:
    bus, at = town.bus(), Pose()
    at.position.y = -5.0
    entities.spawn(bus, "Slow", SLOW_BOT, at)
    return {name: Robot(bus, name) for name in ("Fred", "Slow")}


@contextmanager
def ready(robot: Robot) -> Iterator[Robot]:
    """It stands, no source is held, and former drivers have let go; at the end it is released."""
    trigger(robot, "stop")
    trigger(robot, "release")
    robot.pass_time(0.7)
    robot.resume()
    yield robot
    trigger(robot, "stop")
    trigger(robot, "release")


@pytest.fixture
def fred(robots: dict[str, Robot]) -> Iterator[Robot]:
    with ready(robots["Fred"]) as fred:
        yield fred


def trigger(robot: Robot, verb: str) -> TriggerReply:
    return robot.bus.call(key_for(verb, robot.name), TriggerRequest(), TriggerReply)


def stands_for(robot: Robot, seconds: float, slow: float = SLOW) -> list[Odometry]:
    """Let that much sim time pass, in which the robot may not move."""
    part = robot.odom.from_now()
    robot.pass_time(seconds)
    odoms: list[Odometry] = part.messages()
    assert max(max(map(abs, speeds(odom))) for odom in odoms) < slow
    assert distance(odoms[0], odoms[-1]) < 5e-3
    return odoms


def slows(robot: Robot, limit: float = SLOW) -> Callable[[], object]:
    return lambda: max(map(abs, speeds(robot.newest()))) < limit


@pytest.mark.parametrize("name", ["rover.urdf.xacro", "wheely_boi.xacro"])
def test_whatever_is_commanded_a_stopped_robot_stands(
    verb: Verb, town: Wire, sim: Process, flood: Flood, name: str
) -> None:
    spawn_file(town.bus(), URDF / name, "Rob", SpawnPose(y=5.0))
    with ready(Robot(town.bus(), "Rob")) as robot:
        for node, priority in (("person", PERSON), ("script", SCRIPT), ("autopilot", AUTOPILOT)):
            flood.add("Rob/cmd_vel", Twist.planar(0.4), priority, node)
        if name.startswith("rover"):
            flood.add(
                "Rob/joint_command", JointState(name=WHEELS, velocity=[8.0] * 4), PERSON, "hands"
            )
        robot.odom.next(lambda odom: speeds(odom)[0] > 0.3)
        assert stopped(verb(town, "stop", "Rob").stdout) == ["Rob"]
        wait_for(slows(robot), what="it to stand")
        if name.startswith("wheely"):
            robot.pass_time(1.0)  # what balances sways for a moment
        odoms = stands_for(robot, 0.5)
        assert abs(odoms[-1].pose.pose.orientation.x) < 0.1
        status = robot.status_when(lambda status: status.refused.get("stopped", 0) > 100)
        assert status.stopped.startswith("stop@")
        assert (status.obeyed, status.held) == ("", True)
        stands_for(robot, 0.1)
    entities.delete(robot.bus, "Rob")


def test_at_the_next_step_its_velocity_is_zero(fred: Robot) -> None:
    fred.drive(0.5)
    trigger(fred, "stop")
    assert rests(fred.newest())


SETTER = """
import sys, time
from holozen.bus import Bus
from holozen.transport.connection import Connection
from holozen.messages import TriggerReply, TriggerRequest
with Bus("setter", Connection(connect=(sys.argv[1],), listen=()), lasting=True) as bus:
    bus.call("Fred/stop", TriggerRequest(), TriggerReply)
    print("done", flush=True)
    time.sleep(3600)
"""


def test_it_outlives_its_source(town: Wire, fred: Robot, flood: Flood) -> None:
    with Process([sys.executable, "-c", SETTER, town.endpoint]) as setter:
        setter.wait_for_line("done")
        setter.kill()
    flood.add("Fred/cmd_vel", Twist.planar(0.4), PERSON)
    stands_for(fred, 1.0, 1e-6)
    assert fred.status().stopped.startswith("setter@")


def test_any_zenoh_tool_can_set_it_and_ask_for_it(
    sim: Process, fred: Robot, foreign: zenoh.Session
) -> None:
    def get(key: str) -> dict[str, object]:
        (reply,) = foreign.get(key)
        assert reply.ok is not None
        value: dict[str, object] = json.loads(bytes(reply.ok.payload))
        return value

    def setter() -> object:
        return get("Fred/cmd_vel_status")["stopped"]

    assert get("Fred/stop") == {"success": True, "message": "stopped by an unknown caller"}
    comes_to("an unknown caller", setter)
    get("Fred/release")
    comes_to("", setter)
    sim.signal(signal.SIGSTOP)
    asked = [foreign.get(f"Fred/{verb}") for verb in ("release", "stop")]  # which are read together
    sim.signal(signal.SIGCONT)
    assert [len([*replies]) for replies in asked] == [1, 1]
    comes_to("an unknown caller", setter)
    assert fred.status().stopped == "an unknown caller", "and it stays so"


def test_a_stop_stops_the_robot_whatever_the_request_holds(
    fred: Robot, foreign: zenoh.Session
) -> None:
    for payload, encoding, selector in (
        (b"", "", ""),
        (b"null", "application/json", ""),
        (b'{"reason": "obstacle"}', "application/json", ""),
        (b"now", "text/plain", ""),
        (b"", "application/cdr", ""),
        (b"\xff" * 6_000_000, "image/png", ""),
        (None, "", "?reason=obstacle"),
    ):
        trigger(fred, "release")
        (reply,) = foreign.get(f"Fred/stop{selector}", payload=payload, encoding=encoding or None)
        assert reply.ok is not None
        answer = json.loads(bytes(reply.ok.payload))
        assert answer["success"] is True
        assert answer["message"].startswith(
            "stopped by an unknown caller; the request cannot be read: "
        )
        assert fred.status_when(lambda status: status.stopped == "an unknown caller")


def refuses(robot: Robot, reason: str) -> CommandStatus:
    """Wait until more commands are refused for this reason."""
    before = robot.status().refused.get(reason, 0)
    return robot.status_when(lambda status: status.refused.get(reason, 0) > before + 10)


def flooding(status: CommandStatus) -> CommandSource:
    """The source that speaks most."""
    return max(status.sources, key=lambda source: source.rate)


def test_a_source_that_goes_on_commanding_moves_nothing_until_it_sends_a_stop(
    robots: dict[str, Robot], flood: Flood
) -> None:
    with ready(robots["Slow"]) as slow:
        source = flood.add("Slow/cmd_vel", Twist.planar(0.4), PERSON)
        slow.odom.next(lambda odom: moves(odom, 0.4, 0, 0))
        trigger(slow, "stop")
        assert flooding(refuses(slow, "stopped")).held
        trigger(slow, "release")
        assert refuses(slow, "let go first").stopped == ""
        stands_for(slow, 1.0, 1e-6)
        source.put(Twist())
        slow.odom.next(lambda odom: moves(odom, 0.4, 0, 0))
        assert not flooding(slow.status_when(lambda status: flooding(status).obeyed)).held


def test_an_autopilot_also_waits_for_resume_which_is_refused_during_the_stop(
    fred: Robot, flood: Flood
) -> None:
    trigger(fred, "stop")
    with pytest.raises(
        ServiceError, match=r"^stopped: by .*; `holozen release Fred` lets it drive again$"
    ):
        fred.resume()
    assert trigger(fred, "release").message.endswith(
        "; a controller also waits for `holozen controller Fred --resume`"
    )
    fred.pass_time(0.8)
    flood.add("Fred/cmd_vel", Twist.planar(0.4), AUTOPILOT)
    status = refuses(fred, "held")
    assert status.held
    assert status.last_refusal.endswith("`holozen controller Fred --resume` lets it drive again")
    stands_for(fred, 0.5, 1e-6)
    fred.resume()
    fred.odom.next(lambda odom: moves(odom, 0.4, 0, 0))


def test_a_robot_in_the_place_of_a_stopped_one_is_stopped(
    town: Wire, sim: Process, flood: Flood
) -> None:
    bus, at = town.bus(), Pose()
    at.position.y = -10.0
    entities.spawn(bus, "Ann", SLOW_BOT, at)
    ann = Robot(bus, "Ann")
    trigger(ann, "stop")
    entities.delete(bus, "Ann")
    flood.add("Ann/cmd_vel", Twist.planar(0.4), PERSON)
    entities.spawn(bus, "Ann", SLOW_BOT, at)
    sim.wait_for_line("`holozen release Ann` lets it drive again")
    assert refuses(ann, "stopped").stopped.startswith("test@")
    stands_for(ann, 0.5, 1e-5)  # it lands
    trigger(ann, "release")
    assert refuses(ann, "let go first").stopped == ""
    stands_for(ann, 0.5, 1e-5)  # it lands
    entities.delete(bus, "Ann")


def test_one_command_stops_all_robots_beside_a_process_that_sleeps(
    verb: Verb, town: Wire, robots: dict[str, Robot]
) -> None:
    sleeper = town.start("pose-service")
    sleeper.wait_for_line("goals")
    sleeper.signal(signal.SIGSTOP)
    done = verb(town, "stop")
    assert {*robots} <= {*stopped(done.stdout)}
    assert (done.returncode, done.stderr) == (0, "")
    assert all(robot.status().stopped for robot in robots.values())
    assert verb(town, "release").returncode == 0
    assert not any(robot.status().stopped for robot in robots.values())
    sleeper.signal(signal.SIGCONT)


def test_the_controller_yields_to_it_and_goes_on_after_release_and_resume(
    town: Wire, fred: Robot
) -> None:
    town.start("pose-service").wait_for_line("goals")
    controller = town.start("controller", "Fred", "--laps", "0")
    fred.odom.next(lambda odom: max(map(abs, speeds(odom))) > 0.1)
    trigger(fred, "stop")
    controller.wait_for_line("controller: yields: the robot is stopped by test@")
    stands_for(fred, 0.5, 1e-6)
    trigger(fred, "release")
    controller.wait_for_line("controller: yields to the stop by test@")
    stands_for(fred, 0.5, 1e-6)
    fred.resume()
    fred.odom.next(lambda odom: max(map(abs, speeds(odom))) > 0.1)
    controller.terminate()
