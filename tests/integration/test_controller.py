"""The controller drives from goal to goal, in whatever order the processes start, and gives way to people."""

import re
import signal
from itertools import permutations
from typing import Any

import pytest

from holozen.testing import Process, Wire, wait_for

from .conftest import start_sim
from .robots import Robot, distance, moves, place, rests

LEG = re.compile(r"lap (\d+) goal (\d+): \((.*), (.*), (.*) deg\) in (.*) s, path error (.*) mm")
SQUARE = [(0.5, 0.0, 90), (0.5, 0.5, 180), (0.0, 0.5, -90), (0.0, 0.0, 0)]  # with --size 0.5
FAST = ("--rtf", "8")
GOALS = ("--size", "0.5")


def start(wire: Wire, *verbs: str) -> dict[str, Process]:
    flags: dict[str, tuple[str, ...]] = {"sim": FAST, "pose-service": GOALS, "controller": ()}
    return {verb: wire.start(verb, *flags[verb]) for verb in verbs}


def legs(controller: Process) -> list[tuple[str, ...]]:
    return LEG.findall(controller.out)


@pytest.mark.parametrize("order", list(permutations(["sim", "pose-service", "controller"])), ids="-".join)
def test_it_drives_the_square_and_says_how_well_whoever_started_first(wire: Wire, order: Any) -> None:
    at_work = {"sim": "listens", "pose-service": "goals", "controller": "waiting for "}
    processes: dict[str, Process] = {}
    for verb in order:
        processes |= start(wire, verb)
        if verb != order[-1]:
            processes[verb].wait_for_line(at_work[verb])
    controller = processes["controller"]
    assert controller.wait(within=40) == 0
    lines = legs(controller)
    assert len(controller.out.splitlines()) == len(lines) == 4
    assert [(lap, goal) for lap, goal, *_ in lines] == [("1", str(i)) for i in range(4)]
    assert [(float(x), float(y), int(deg)) for _, _, x, y, deg, *_ in lines] == SQUARE
    robot = Robot(wire.bus())
    assert place(robot.stands()) == pytest.approx((0, 0, 0), abs=0.04)
    assert "Traceback" not in controller.err


def test_it_keeps_near_the_straight_line_and_tells_time_and_error_of_each_leg(wire: Wire) -> None:
    start_sim(wire, "--rtf", "2")
    wire.start("pose-service", "--size", "0.3")
    controller = wire.start("controller")
    assert controller.wait(within=40) == 0
    lines = legs(controller)
    assert len(lines) == 4
    # 0.3 m at 0.5 m/s, and 90 degrees at 1 rad/s meanwhile.
    assert all(1.5 < float(seconds) < 5 and float(error) < 50 for *_, seconds, error in lines)


class Scene:
    """A controller that drives round and round, and a robot that a person may take."""

    def __init__(self, wire: Wire) -> None:
        self.sim = start_sim(wire)
        wire.start("pose-service")
        self.controller = wire.start("controller", "--laps", "0")
        self.robot = Robot(wire.bus())
        self.person = Robot(wire.bus("person"), priority="INTERACTIVE_HIGH")

    def controller_drives(self) -> None:
        wait_for(lambda: self.robot.status().obeyed.startswith("controller@"))
        self.robot.odom.next(lambda odom: not rests(odom))


@pytest.fixture
def scene(wire: Wire) -> Scene:
    scene = Scene(wire)
    scene.controller_drives()
    return scene


def test_it_yields_to_a_person_and_stays_off_until_resume(wire: Wire, scene: Scene) -> None:
    scene.person.drive(0, -0.3)
    assert scene.controller.wait_for_line("yields to person@")
    scene.person.drive(0, 0)
    stood = scene.robot.stands()
    later = scene.robot.pass_time(1.0)
    assert distance(stood, later) < 1e-3, "it does not take the robot back"
    done = wire.run("controller", "--resume")
    assert (done.returncode, done.stderr) == (0, "every source may drive\n")
    scene.controller_drives()
    scene.controller.wait_for_line("continues")


def test_it_says_nothing_on_cmd_vel_while_a_person_has_the_robot(scene: Scene) -> None:
    scene.person.drive(0, -0.3)
    scene.controller.wait_for_line("yields to person@")
    seen = len(scene.robot.commands.all())
    scene.person.drive(0.3)
    sources = {received.sample.source for received in scene.robot.commands.all()[seen:]}
    assert {source.partition("@")[0] for source in sources} == {"person"}


def test_a_person_who_puts_by_hand_with_a_stranger_s_tool_is_yielded_to(scene: Scene) -> None:
    def taken() -> bool:
        scene.person.bus.session.put("cmd_vel", b'{"linear":{"x":-0.2}}')
        return moves(scene.robot.newest(), -0.2, 0, 0)

    wait_for(taken)
    assert scene.controller.wait_for_line("yields to anonymous (DATA)")


def test_the_teleops_r_hands_over(wire: Wire, scene: Scene) -> None:
    terminal = wire.terminal("teleop")
    terminal.wait_for_text("controller@")
    terminal.type(",")
    scene.robot.odom.next(lambda odom: moves(odom, -0.5, 0, 0))
    terminal.wait_for_text("you drive")
    terminal.type("k")
    scene.controller.wait_for_line("yields to teleop@")
    terminal.wait_for_text("no driver; the autopilot is held")
    scene.robot.stands()
    terminal.type("r")
    scene.controller_drives()
    terminal.wait_for_text("controller@")


def test_the_teleops_r_hands_over_in_the_middle_of_a_drive(wire: Wire, scene: Scene) -> None:
    terminal = wire.terminal("teleop", "--key-timeout", "0")
    terminal.wait_for_text("controller@")
    terminal.type(",")
    terminal.wait_for_text("you drive")
    terminal.type("r")
    scene.controller_drives()
    terminal.wait_for_text("controller@")


def test_it_stops_when_odom_stops_and_goes_on_when_the_sim_is_back(wire: Wire, scene: Scene) -> None:
    scene.sim.kill()
    scene.controller.wait_for_line("waiting for odom: it is stale, or none was received")
    scene.robot.told_to_stop()
    start_sim(wire)
    scene.controller_drives()
    assert scene.controller.returncode is None


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP], ids=lambda n: n.name)
def test_told_to_end_it_stops_the_robot_first(scene: Scene, number: int) -> None:
    scene.controller.signal(number)
    assert scene.controller.wait() == 0
    scene.robot.told_to_stop()
    scene.robot.stands()
    assert "Traceback" not in scene.controller.err


def test_killed_it_leaves_a_robot_that_stands(scene: Scene) -> None:
    scene.controller.kill()
    last = scene.robot.newest()
    assert distance(last, scene.robot.stands()) < 0.5 * 0.65


def test_it_has_patience_with_a_pose_service_that_comes_and_goes(wire: Wire) -> None:
    start(wire, "sim")
    controller = wire.start("controller", "--laps", "2")
    controller.wait_for_line("waiting for goal 0: no reply from 'next_goal'")
    service = start(wire, "pose-service")["pose-service"]
    wait_for(lambda: len(legs(controller)) == 4, 40)
    service.kill()
    start(wire, "pose-service")
    assert controller.wait(40) == 0
    assert [lap for lap, *_ in legs(controller)] == ["1"] * 4 + ["2"] * 4


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["a/b"], "robot name 'a/b'"),
        (["--laps", "-1"], "'-1': use a whole number from 0 up"),
        (["--laps", "many"], "'many'"),
        (["--max-speed", "0"], "'0': use a number from 0.01 to 10 m/s"),
        (["--tolerance", "nan"], "'nan'"),
    ],
)
def test_a_wrong_flag_is_told_in_one_line(town: Wire, words: list[str], reason: str) -> None:
    done = town.run("controller", *words)
    assert done.returncode == 2
    assert reason in done.stderr.splitlines()[-1]
