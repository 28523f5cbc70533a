"""The controller drives from goal to goal, in whatever order the processes start, and gives way to
people.
"""

import contextlib
import re

import pytest

from holozen.testing import Process, Terminal, Wire, wait_for
from holozen.transport.errors import ServiceError

from .conftest import Verb, start_sim
from .processes import assert_one_line
from .robots import Robot, distance, moves, place, rests

LEG = re.compile(r"lap (\d+) goal (\d+): \((.*), (.*), (.*) deg\) in (.*) s, path error (.*) mm")
SQUARE = [(0.5, 0.0, 90), (0.5, 0.5, 180), (0.0, 0.5, -90), (0.0, 0.0, 0)]  # with --size 0.5
# faster, a stop that a busy machine delays by some ms turns the robot too far
FAST = ("--rtf", "2")
GOALS = ("--size", "0.5")


def start(wire: Wire, *verbs: str) -> dict[str, Process]:
    flags: dict[str, tuple[str, ...]] = {"sim": FAST, "pose-service": GOALS, "controller": ()}
    return {verb: wire.start(verb, *flags[verb]) for verb in verbs}


def legs(controller: Process) -> list[tuple[str, ...]]:
    return LEG.findall(controller.out)


def test_it_drives_the_square_and_reports_how_well_also_if_the_sim_starts_last(wire: Wire) -> None:
    start(wire, "pose-service")["pose-service"].wait_for_line("goals")
    controller = start(wire, "controller")["controller"]
    controller.wait_for_line("waiting for ")
    start(wire, "sim")
    assert controller.wait(within=40) == 0
    lines = legs(controller)
    assert len(controller.out.splitlines()) == len(lines) == 4
    assert [(lap, goal) for lap, goal, *_ in lines] == [("1", str(i)) for i in range(4)]
    assert [(float(x), float(y), int(deg)) for _, _, x, y, deg, *_ in lines] == SQUARE
    robot = Robot(wire.bus())
    # in lock-step it is there to a centimetre; a busy machine delays the last stop
    assert place(robot.stands()) == pytest.approx((0, 0, 0), abs=0.1)
    assert "Traceback" not in controller.err


class Scene:
    """A controller that drives round and round, and a robot that a person may take."""

    def __init__(self, wire: Wire) -> None:
        self.sim = start_sim(wire)
        wire.start("pose-service")
        self.controller = wire.start("controller", "--laps", "0")
        self.robot = Robot(wire.bus())
        self._wire = wire

    def person(self, name: str) -> Robot:
        """The robot as a person has it; each test's has a name of its own, which the controller
        reports.
        """
        return Robot(self._wire.bus(name), priority="INTERACTIVE_HIGH")

    def takes_over(self, person: Robot, name: str) -> None:
        """The person drives until the controller has noticed who does."""
        wait_for(lambda: person.drive(0, -0.3) and f"yields to {name}@" in self.controller.err)

    def controller_is_obeyed(self) -> bool:
        return self.robot.status().obeyed.startswith("controller@")

    def controller_drives(self) -> None:
        wait_for(
            self.controller_is_obeyed,
            what=lambda: (
                f"the controller to drive: {self.robot.status()}, {self.controller.err[-500:]}"
            ),
        )
        self.robot.odom.next(lambda odom: not rests(odom))


@pytest.fixture
def scene(wire: Wire) -> Scene:
    """A scene of a test that ends parts of it."""
    scene = Scene(wire)
    scene.controller_drives()
    return scene


@pytest.fixture(scope="module")
def played(town: Wire) -> Scene:
    return Scene(town)


@pytest.fixture
def shared(played: Scene) -> Scene:
    """The file's scene: the controller drives."""

    def handed_over() -> bool:
        with contextlib.suppress(ServiceError):
            return bool(played.robot.resume())
        return False

    wait_for(handed_over, what="the robot to be handed over")
    played.controller_drives()
    return played


def test_it_yields_to_a_person_and_stays_off_until_resume(town: Wire, shared: Scene) -> None:
    anna = shared.person("anna")
    shared.takes_over(anna, "anna")
    continued = shared.controller.err.count("continues")
    anna.drive(0, 0)
    stood = shared.robot.stands()
    later = shared.robot.pass_time(1.0)
    assert distance(stood, later) < 1e-3, "it does not take the robot back"
    waited = shared.controller.err.count("waiting for")
    assert shared.controller.err.count("continues") == continued
    done = town.run("controller", "--resume")
    assert (done.returncode, done.stderr) == (0, "every source may drive\n")
    shared.controller_drives()

    def has_continued() -> bool:
        """Once, and after each time that a busy machine made it wait."""
        waits = shared.controller.err.count("waiting for") - waited
        return shared.controller.err.count("continues") == continued + 1 + waits

    wait_for(has_continued, what="it to report that")


def test_it_publishes_no_cmd_vel_while_a_person_has_the_robot(shared: Scene) -> None:
    tom = shared.person("tom")
    shared.takes_over(tom, "tom")
    commands = shared.robot.commands.from_now()
    tom.drive(0.3)
    commands.next()
    assert {received.source.partition("@")[0] for received in commands.all()} == {"tom"}


def test_a_person_publishing_by_hand_with_a_foreign_tool_is_yielded_to(shared: Scene) -> None:
    def taken() -> bool:
        shared.robot.bus.session.put("cmd_vel", b'{"linear":{"x":-0.2}}')
        return moves(shared.robot.newest(), -0.2, 0, 0)

    wait_for(taken)
    assert shared.controller.wait_for_line("yields to anonymous (DATA)")


def test_the_teleops_r_hands_over(town: Wire, shared: Scene) -> None:
    with town.terminal("teleop", "--key-timeout", "0") as terminal:
        terminal.wait_for_text("controller@")
        terminal.hold_until(",", lambda: moves(shared.robot.newest(), -0.5, 0, 0))
        terminal.wait_for_text("you drive")
        terminal.type("k")
        shared.controller.wait_for_line("yields to teleop@")
        terminal.wait_for_text("no driver; the autopilot is held")
        shared.robot.stands()
        hands_over(terminal, shared)


def hands_over(terminal: Terminal, shared: Scene) -> None:
    """A person presses r, and again if the sim was too busy to answer in time."""

    def pressed() -> bool:
        terminal.type("r")
        wait_for(
            lambda: (
                "not handed over: no reply" in terminal.screen() or shared.controller_is_obeyed()
            )
        )
        return shared.controller_is_obeyed()

    wait_for(pressed)
    shared.controller_drives()
    terminal.wait_for_text("controller@")


def test_the_teleops_r_hands_over_in_the_middle_of_a_drive(town: Wire, shared: Scene) -> None:
    with town.terminal("teleop", "--key-timeout", "0") as terminal:
        terminal.wait_for_text("controller@")
        terminal.hold_until(",", lambda: "you drive" in terminal.screen())
        hands_over(terminal, shared)


def test_it_stops_when_odom_stops_goes_on_when_it_is_back_and_stops_the_robot_before_it_ends(
    wire: Wire, scene: Scene
) -> None:
    scene.sim.kill()
    scene.controller.wait_for_line("waiting for odom: it is stale, or none was received")
    scene.robot.wait_for_stop_command()
    start_sim(wire)
    scene.controller_drives()
    assert scene.controller.terminate() == 0
    scene.robot.wait_for_stop_command()
    scene.robot.stands()
    assert "Traceback" not in scene.controller.err


def test_a_robot_that_is_not_there_is_reported_with_those_that_are(
    town: Wire, shared: Scene
) -> None:
    controller = town.start("controller", "Fred")
    controller.wait_for_line(
        "waiting for Fred: no node publishes its odom; there are: the one at the root of the keys"
    )
    assert controller.terminate() == 0


def test_killed_it_leaves_a_robot_that_stands_and_one_started_at_once_drives_it(
    scene: Scene, wire: Wire
) -> None:
    scene.controller.kill()
    odoms = scene.robot.odom.from_now()
    last = odoms.next()
    scene.controller = wire.start("controller", "--laps", "0")
    assert distance(last, odoms.next(rests)) < 0.5 * 0.65
    scene.controller_drives()


def test_it_has_patience_with_a_pose_service_that_comes_last_and_goes(wire: Wire) -> None:
    controller = start(wire, "controller")["controller"]
    controller.wait_for_line("waiting for ")
    start(wire, "sim")
    controller.wait_for_line("waiting for goal 0: no reply from 'next_goal'")
    robot = Robot(wire.bus())
    service = start(wire, "pose-service")["pose-service"]
    robot.odom.next(lambda odom: place(odom)[0] > 0.4)  # on its way to the first goal
    service.kill()
    start(wire, "pose-service")
    robot.odom.next(lambda odom: place(odom)[1] > 0.3)  # and to the second
    assert controller.returncode is None


def test_a_wrong_flag_is_one_error_line(wire: Wire, verb: Verb) -> None:
    for words, reason in ((["a/b"], "robot name 'a/b'"), (["--tolerance", "nan"], "'nan'")):
        assert_one_line(verb(wire, "controller", *words), 2, reason)
