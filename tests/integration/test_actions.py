"""Goals for the controller and for the sim, sent by `holozen action`, and whatever ends them."""

import json
import math
import signal
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import pytest

from holozen import data
from holozen.messages import PoseStamped, TriggerReply, TriggerRequest
from holozen.messages.geometry_msgs import Point, Pose
from holozen.messages.std_msgs import Header
from holozen.testing import LockStep, Process, Wire, wait_for

from .conftest import Verb, comes_to, start_sim
from .processes import assert_one_line
from .robots import Robot, moves, place, rests

BOT = str(data.find("urdf", "hb_bot.urdf.xacro"))
FAR = 1e5  # m; a goal that is not reached
END = "the controller "
REMOVED = "the robot was removed or replaced, or the link to it was lost"
RESET = "the robot was reset or moved"
SPAWN = ("spawn", "--timeout", "30", BOT, "--name", "Fred", "-x", "20")


def pose(x: float, y: float = 0.0, **more: Any) -> dict[str, Any]:
    return {"pose": {"position": {"x": x, "y": y}}, **more}


def send(wire: Wire, action: str, goal: Any) -> Process:
    return wire.start("action", "send_goal", action, json.dumps(goal), "--feedback", "--json")


def sent(wire: Wire, x: float) -> Process:
    """A goal on the way to which the robot is."""
    process = send(wire, "navigate_to_pose", {"pose": pose(x)})
    process.wait_for_line("distance_remaining")
    return process


def result(process: Process) -> tuple[str, Any]:
    """The last status and result."""
    process.wait()
    last = json.loads(process.out.splitlines()[-1])
    assert process.returncode == (
        130 if last["status"] == "CANCELED" else int(last["status"] != "SUCCEEDED")
    )
    return last["status"], last["result"]


def aborted(process: Process) -> str:
    """The reason."""
    status, outcome = result(process)
    assert (status, outcome["error_code"]) == ("ABORTED", 9000)
    return str(outcome["error_msg"])


@pytest.fixture(scope="module")
def town() -> Iterator[Wire]:
    """A wire with a sim and a controller that has no list of goals."""
    with Wire() as wire:
        start_sim(wire)
        wire.start("controller", "--laps", "0").wait_for_line("waiting for goal 0")
        yield wire


@pytest.fixture(scope="module")
def freds() -> Iterator[Wire]:
    """A wire with a sim and a controller of a robot with a name."""
    with Wire() as wire:
        start_sim(wire, "--robot", f"{BOT}=Fred")
        wire.start("controller", "Fred", "--laps", "0").wait_for_line("waiting for goal 0")
        yield wire


@pytest.fixture(scope="module")
def robot(town: Wire) -> Robot:
    return Robot(town.bus())


def test_the_robot_drives_to_a_pose_and_tells_how_far_it_is(town: Wire, robot: Robot) -> None:
    x = place(robot.newest())[0]
    process = send(town, "navigate_to_pose", {"pose": pose(x + 0.3, header={"frame_id": "odom"})})
    assert result(process) == ("SUCCEEDED", {"error_code": 0, "error_msg": ""})
    told = [json.loads(line)["feedback"] for line in process.out.splitlines() if "feedback" in line]
    for feedback in told:
        at = feedback["current_pose"]["pose"]["position"]
        left = math.dist((x + 0.3, 0.0), (at["x"], at["y"]))
        assert feedback["distance_remaining"] == pytest.approx(left, abs=0.01)
    assert told[-1]["distance_remaining"] < told[0]["distance_remaining"]
    assert told[-1]["current_pose"]["header"]["frame_id"] == "odom"
    assert place(robot.stands())[:2] == pytest.approx((x + 0.3, 0.0), abs=0.05)


def test_the_robot_follows_waypoints_from_an_index_on_and_in_loops(
    town: Wire, robot: Robot
) -> None:
    poses = [pose(0.3), pose(0.2, 0.1)]
    process = send(
        town, "follow_waypoints", {"poses": poses, "goal_index": 1, "number_of_loops": 1}
    )
    assert result(process) == (
        "SUCCEEDED",
        {"missed_waypoints": [], "error_code": 0, "error_msg": ""},
    )
    numbers = [
        json.loads(line)["feedback"]["current_waypoint"]
        for line in process.out.splitlines()
        if "feed" in line
    ]
    assert [number for number, _ in groupby(numbers)] == [1, 0, 1]
    assert place(robot.stands())[:2] == pytest.approx((0.2, 0.1), abs=0.05)


def test_a_wrong_goal_is_rejected_with_the_reason(town: Wire, verb: Verb) -> None:
    for action, goal, reason in (
        (
            "navigate_to_pose",
            {"pose": pose(1.0, header={"frame_id": "moon"})},
            "its frame is 'moon'; give it in",
        ),
        ("navigate_to_pose", {"pose": pose(1e9)}, "it is more than 1e+06 m away"),
        ("navigate_to_pose", {"behavior_tree": "a.xml"}, "there are no behavior trees here"),
        ("follow_waypoints", {}, "it has no poses"),
        (
            "follow_waypoints",
            {"poses": [pose(0), pose(1e9)]},
            "pose 1: it is more than 1e+06 m away",
        ),
        ("follow_waypoints", {"poses": [pose(0)], "goal_index": 1}, "goal_index is 1; use 0 to 0"),
        (
            "follow_waypoints",
            {"poses": [pose(0)], "number_of_loops": 20000},
            "at most 10000 in all",
        ),
    ):
        done = verb(town, "action", "send_goal", action, json.dumps(goal), "--feedback", "--json")
        assert_one_line(done, 1, reason)


def test_ctrl_c_cancels_the_goal_and_the_robot_stands(town: Wire, robot: Robot) -> None:
    process = sent(town, FAR)
    process.signal(signal.SIGINT)
    assert result(process) == ("CANCELED", {"error_code": 9000, "error_msg": "it was cancelled"})
    robot.stands()


def test_a_newer_goal_ends_the_one_before(town: Wire, robot: Robot) -> None:
    first = sent(town, FAR)
    second = sent(town, FAR)
    assert aborted(first) == "a newer goal came"
    goals = town.bus().publisher("goal_pose", PoseStamped)
    echoes = goals.echoes
    assert echoes is not None
    wait_for(lambda: goals.matched and echoes.may_command(), what="the controller to be heard")
    here = robot.newest().pose.pose.position
    goals.put(PoseStamped(Header(frame_id="odom"), Pose(Point(here.x, here.y, 0.0))))
    assert aborted(second) == "a newer goal came on goal_pose"
    robot.stands()


def test_a_person_who_drives_and_a_stop_end_the_goal(town: Wire, robot: Robot) -> None:
    process = sent(town, FAR)
    person = Robot(town.bus("ann"), priority="INTERACTIVE_HIGH")
    wait_for(lambda: person.drive(0, -0.3) and process.returncode is not None)
    assert aborted(process).startswith(f"{END}yields to ann@")
    person.stop()
    held = send(town, "navigate_to_pose", {"pose": pose(FAR)})
    assert aborted(held).startswith(f"{END}yields to ann@")
    wait_for(robot.resume)
    process = sent(town, FAR)
    bus = town.bus("bob")
    bus.call("stop", TriggerRequest(), TriggerReply)
    assert aborted(process).startswith(f"{END}yields: the robot is stopped by bob@")
    robot.stands()
    bus.call("release", TriggerRequest(), TriggerReply)
    bus.call("resume", TriggerRequest(), TriggerReply)


def test_a_controller_that_ends_and_a_sim_that_dies_end_the_goal(wire: Wire) -> None:
    sim = start_sim(wire)
    controller = wire.start("controller", "--laps", "0")
    controller.wait_for_line("waiting for goal 0")
    process = sent(wire, FAR)
    sim.signal(signal.SIGSTOP)
    assert aborted(process) == "there was no odom to act on for 2 s"
    sim.signal(signal.SIGCONT)
    process = sent(wire, FAR)
    sim.kill()
    assert aborted(process) == REMOVED
    start_sim(wire)
    process = sent(wire, FAR)
    controller.signal(signal.SIGINT)
    assert aborted(process) == "the controller ends"
    Robot(wire.bus()).stands()


@pytest.mark.parametrize(
    ("verbs", "reason"),
    [
        ([("sim", "reset", "--scope", "state")], RESET),
        ([("delete", "Fred"), SPAWN], REMOVED),
    ],
    ids=["state", "deleted and spawned"],
)
def test_a_goal_is_not_driven_to_by_the_next_robot_or_after_a_reset(
    freds: Wire, verb: Verb, verbs: list[tuple[str, ...]], reason: str
) -> None:
    fred = Robot(freds.bus(), "Fred")
    goal = send(freds, "Fred/navigate_to_pose", {"pose": pose(FAR)})
    fred.odom.next(lambda odom: not rests(odom))
    for words in verbs:
        assert verb(freds, *words).returncode == 0
    fred.stands()
    odoms = fred.odom.from_now()
    fred.pass_time(0.5)
    # a spawned one comes to rest on the floor
    assert all(moves(odom, 0, 0, 0) for odom in odoms.messages())
    assert aborted(goal) == reason


def test_the_sim_makes_steps_and_tells_how_many(wire: Wire) -> None:
    sim = LockStep(wire)
    process = send(wire, "simulate_steps", {"steps": 10})
    assert result(process) == ("SUCCEEDED", {"result": {"result": 1, "error_message": ""}})
    assert '{"feedback": {"completed_steps": 10, "remaining_steps": 0}}' in process.out.splitlines()
    sim.bus.call("stop", TriggerRequest(), TriggerReply)
    process = send(wire, "simulate_steps", {"steps": 10_000_000})
    process.wait_for_line("completed_steps")
    other = send(wire, "simulate_steps", {"steps": 1})
    assert result(other)[1]["result"]["error_message"] == "other steps are being made"
    process.signal(signal.SIGINT)
    status, outcome = result(process)
    assert status == "CANCELED"
    assert outcome["result"]["error_message"].startswith("the goal was cancelled, ")
    assert (
        result(send(wire, "simulate_steps", {}))[1]["result"]["error_message"]
        == "steps is 0; use 1 to 10000000"
    )
    wire.run("sim", "play")
    playing = result(send(wire, "simulate_steps", {"steps": 1}))[1]["result"]["error_message"]
    assert playing.startswith("the sim is playing; pause it to step")


def test_the_lists_leave_out_what_an_action_consists_of(town: Wire, verb: Verb) -> None:
    for words, hidden in (
        (("topic", "list"), "simulate_steps/_action/feedback"),
        (("service", "list"), "simulate_steps/_action/send_goal"),
    ):
        assert "_action" not in verb(town, *words).stdout
        every = (*words, f"--include-hidden-{words[0]}s")
        wait_for(lambda: hidden in verb(town, *every).stdout.splitlines())  # noqa: B023
    listed = "follow_waypoints\nnavigate_to_pose\nsimulate_steps\n"
    comes_to(listed, lambda: verb(town, "action", "list").stdout)
    kind = "nav2_msgs/action/NavigateToPose\n"
    comes_to(kind, lambda: verb(town, "action", "type", "/navigate_to_pose").stdout)
