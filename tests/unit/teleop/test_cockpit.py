"""The pilot on a real bus: keys are published at once, a stop until the robot rests, and else nothing."""

import math
from collections.abc import Callable
from typing import TypeVar

import pytest

from holozen.bus import Bus, Publisher, ServiceError, Subscription
from holozen.messages import CommandStatus, Odometry, TriggerReply, TriggerRequest, Twist, TwistStamped
from holozen.testing import Wire, wait_for
from services.teleop import cockpit as module
from services.teleop.cockpit import RESTS, RESUME_TIMEOUT, Cockpit
from services.teleop.pilot import Pilot, Settings

T = TypeVar("T")


class Robot:
    """The other side: what arrives on cmd_vel, and the odom that it tells."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.commands: Subscription[Twist | TwistStamped] = bus.subscribe("Fred/cmd_vel", Twist, TwistStamped)
        self.odom: Publisher[Odometry] = bus.publisher("Fred/odom", Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher("Fred/cmd_vel_status", CommandStatus)

    def tell(self, x: float, y: float = 0.0, turn: float = 0.0) -> None:
        odom = Odometry()
        odom.twist.twist = Twist.planar(x, y, turn)
        self.odom.put(odom)

    def status(self, **fields: object) -> None:
        self._status.put(CommandStatus(**fields))  # type: ignore[arg-type]

    def heard(self) -> list[Twist | TwistStamped | None]:
        return [received.message for received in iter(self.commands.try_recv, None)]


@pytest.fixture
def robot(wire: Wire) -> Robot:
    return Robot(wire.bus("sim"))


def cockpit_of(wire: Wire, robot: Robot, settings: Settings | None = None, stamped: str | None = None) -> Cockpit:
    pilot = Pilot(settings or Settings(key_timeout=0, repeat_rate=0))
    cockpit = Cockpit(wire.bus("teleop"), "Fred", pilot, stamped)
    wait_for(lambda: cockpit.state().listeners)
    return cockpit


def see(cockpit: Cockpit, robot: Robot, x: float, y: float = 0.0, turn: float = 0.0) -> None:
    """Have the robot tell its speed once, and wait until the cockpit has it."""
    wait_for(lambda: robot.odom.matched)
    before = cockpit._odom.count
    robot.tell(x, y, turn)
    wait_for(lambda: cockpit._odom.count > before)
    assert cockpit.state().measured == (x, y, turn)


def press(cockpit: Cockpit, key: str) -> None:
    """A key in a terminal whose screen is alive."""
    cockpit.tick()
    cockpit.press(key)


def tick(cockpit: Cockpit, until: Callable[[], T]) -> T:
    """Tick until `until()` is true."""

    def look() -> T:
        cockpit.tick()
        return until()

    return wait_for(look)


def test_an_idle_teleop_publishes_nothing(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot, Settings(repeat_rate=1000))
    for _ in range(50):
        cockpit.tick()
    press(cockpit, "q")
    cockpit.let_go()
    cockpit.halt()
    press(cockpit, "i")
    assert robot.commands.recv().message == Twist.planar(0.55)  # and nothing before it


def test_a_key_is_published_at_once_with_the_priority_of_a_person(wire: Wire, robot: Robot) -> None:
    press(cockpit_of(wire, robot), "J")
    received = robot.commands.recv()
    assert received.message == Twist.planar(0, 0.5)
    assert received.sample.priority == "INTERACTIVE_HIGH"
    assert received.sample.source.startswith("teleop@")


def test_a_key_that_drives_is_repeated_at_its_rate(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot, Settings(key_timeout=0, repeat_rate=1000))
    press(cockpit, "i")
    for _ in range(3):
        assert tick(cockpit, robot.heard)[0] == Twist.planar(0.5)


def test_with_a_rate_of_zero_only_a_change_is_published(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    for _ in range(100):
        cockpit.tick()
    press(cockpit, "j")
    assert [robot.commands.recv().message for _ in range(2)] == [Twist.planar(0.5), Twist.planar(turn=1.0)]


def test_a_key_that_timed_out_is_a_stop(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot, Settings(key_timeout=0.01, repeat_rate=0))
    press(cockpit, "i")
    assert robot.commands.recv().message == Twist.planar(0.5)
    assert tick(cockpit, robot.heard)[0] == Twist()


def test_a_stop_is_repeated_until_odom_that_is_newer_shows_rest(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    robot.heard()
    press(cockpit, "k")
    assert robot.commands.recv().message == Twist()
    assert tick(cockpit, robot.heard)[0] == Twist()  # the robot still moves
    see(cockpit, robot, RESTS / 2)
    tick(cockpit, lambda: not cockpit.pilot.engaged)
    robot.heard()
    for _ in range(20):
        cockpit.tick()
    assert cockpit.state().command is None


def test_odom_from_before_the_stop_is_no_proof_of_rest(wire: Wire, robot: Robot) -> None:
    """A robot that stood when the key went down has started since."""
    cockpit = cockpit_of(wire, robot)
    see(cockpit, robot, RESTS / 2)
    press(cockpit, "i")
    press(cockpit, "k")
    cockpit.tick()
    assert cockpit.pilot.engaged


@pytest.mark.parametrize("speed", [(0.02, 0, 0), (0, -0.02, 0), (0, 0, 0.02)])
def test_a_robot_that_moves_in_any_way_does_not_rest(
    wire: Wire, robot: Robot, speed: tuple[float, float, float]
) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "k")
    see(cockpit, robot, *speed)
    cockpit.tick()
    assert cockpit.pilot.engaged


def test_halt_stops_a_robot_and_returns_when_it_rests(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    robot.heard()
    cockpit.halt()  # nobody tells that it rests: given up after a second
    heard = robot.heard()
    assert len(heard) > 10
    assert set(map(str, heard)) == {str(Twist())}
    assert not cockpit.pilot.engaged


def test_stamped_commands_have_the_time_and_the_frame(wire: Wire, robot: Robot) -> None:
    press(cockpit_of(wire, robot, stamped="base_link"), "i")
    message = robot.commands.recv().message
    assert isinstance(message, TwistStamped)
    assert message.twist == Twist.planar(0.5)
    assert message.header.frame_id == "base_link"
    assert message.header.stamp.seconds() > 1.7e9


def test_the_state_shows_the_robot_and_who_drives_it(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    before = cockpit.state()
    assert (before.robot, before.command, before.odom_age, before.stale) == ("Fred", None, math.inf, True)
    assert (before.speed, before.turn, before.listeners, before.obeyed) == (0.5, 1.0, ["sim"], "")
    robot.status(obeyed="controller@1", held=True)
    wait_for(lambda: cockpit.state().obeyed == "controller@1" and cockpit.state().held)
    see(cockpit, robot, 0.25)
    wait_for(lambda: cockpit.state().stale)  # the robot says no more
    press(cockpit, "l")
    assert cockpit.state().command == (0, 0, -1)


@pytest.fixture
def resume(robot: Robot) -> list[str]:
    """Serves `resume`; a reason in the list is the next refusal."""
    reasons: list[str] = []

    def answer(_request: TriggerRequest) -> TriggerReply:
        if reasons:
            raise ServiceError(reasons.pop())
        return TriggerReply(True, "every source may drive")

    robot.bus.serve("Fred/resume", TriggerRequest, TriggerReply, answer).start()
    return reasons


def test_the_resume_key_asks_the_sim_and_shows_its_answer(wire: Wire, robot: Robot, resume: list[str]) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "r")
    assert tick(cockpit, lambda: cockpit.state().note) == "every source may drive"
    assert cockpit.state().command is None
    resume.append("somebody drives; stop first")
    press(cockpit, "r")
    assert tick(cockpit, lambda: cockpit.state().note) == "not handed over: somebody drives; stop first"
    press(cockpit, "q")
    assert cockpit.state().note == ""
    assert robot.heard() == []


def test_the_resume_key_stops_the_robot_first(wire: Wire, robot: Robot, resume: list[str]) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    press(cockpit, "r")
    for _ in range(10):
        cockpit.tick()
    assert cockpit.state().note == ""  # not while it moves
    see(cockpit, robot, 0.0)
    assert tick(cockpit, lambda: cockpit.state().note) == "every source may drive"
    assert [robot.commands.recv().message for _ in range(2)] == [Twist.planar(0.5), Twist()]


def test_another_key_takes_the_resume_back(wire: Wire, robot: Robot, resume: list[str]) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    press(cockpit, "r")
    press(cockpit, "i")
    for _ in range(10):
        cockpit.tick()
    assert cockpit.state().note == ""
    assert cockpit.state().command == (0.5, 0, 0)


def test_without_a_sim_the_resume_key_says_so(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "r")
    told = tick(cockpit, lambda: cockpit.state().note)
    assert told.startswith(f"not handed over: no reply from 'Fred/resume' within {RESUME_TIMEOUT} s")


def test_a_key_that_was_typed_while_the_screen_stood_still_drives_nobody(
    wire: Wire, robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-Z and fg, or a laptop that slept: what waits in the terminal is from before."""
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    assert robot.commands.recv().message == Twist.planar(0.5)
    monkeypatch.setattr(module, "STALL", -1.0)  # as if the last tick was long ago
    cockpit.press("l")
    assert robot.commands.recv().message == Twist()
    cockpit.press("l")
    monkeypatch.undo()
    press(cockpit, "j")
    heard = iter(lambda: robot.commands.recv().message, Twist.planar(turn=1.0))
    assert set(map(str, heard)) <= {str(Twist())}
