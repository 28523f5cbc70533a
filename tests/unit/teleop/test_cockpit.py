"""The pilot on a real bus: keys are published at once, a stop until the robot rests, and else nothing."""

import math
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

import pytest

from holozen.bus import Bus
from holozen.errors import ServiceError
from holozen.messages import (
    CommandSource,
    CommandStatus,
    Odometry,
    Time,
    TriggerReply,
    TriggerRequest,
    Twist,
    TwistStamped,
)
from holozen.publisher import Publisher
from holozen.readers import Subscription
from holozen.testing import Wire, wait_for
from services.teleop.cockpit import ANEW, BLIND, ON_THE_WAY, RESUME_TIMEOUT, Cockpit
from services.teleop.dials import Dials, Track
from services.teleop.grip import LATCH
from services.teleop.helm import LOST, RESTS
from services.teleop.keys import Answer, Focus, Key, Unknown
from services.teleop.layouts import TTK
from services.teleop.pilot import Pilot, Settings
from services.teleop.view import State

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

    def is_heard(self) -> bool:
        """Whether what it tells from now on arrives."""
        return self.odom.matched and self._status.matched

    def heard(self) -> list[Twist | TwistStamped | None]:
        return [received.message for received in iter(self.commands.try_recv, None)]


@pytest.fixture
def robot(wire: Wire) -> Robot:
    return Robot(wire.bus("sim"))


def cockpit_of(wire: Wire, robot: Robot, settings: Settings | None = None, stamped: str | None = None) -> Cockpit:
    pilot = Pilot(settings or Settings(mode=LATCH, repeat_rate=0), TTK)
    cockpit = Cockpit(wire.bus("teleop"), ["Fred"], pilot, stamped)
    wait_for(cockpit.listeners)
    wait_for(robot.is_heard)
    return cockpit


def see(cockpit: Cockpit, robot: Robot, x: float, y: float = 0.0, turn: float = 0.0) -> None:
    """Have the robot tell its speed once, and wait until the cockpit has it."""
    wait_for(lambda: robot.odom.matched)
    before = cockpit.helm.odom.count
    robot.tell(x, y, turn)
    wait_for(lambda: cockpit.helm.odom.count > before)


def tell_place(cockpit: Cockpit, robot: Robot, stamp: float, x: float) -> None:
    """Have the robot tell when it is where, and the cockpit look at it."""
    odom, before = Odometry(), cockpit.helm.odom.count
    odom.header.stamp, odom.pose.pose.position.x = Time.of(stamp), x
    robot.odom.put(odom)
    wait_for(lambda: cockpit.helm.odom.count > before)
    cockpit.tick(time.monotonic())


def press(cockpit: Cockpit, key: str) -> None:
    """A key in a terminal that tells no releases."""
    cockpit.take(Key(key, key), time.monotonic())


def tick(cockpit: Cockpit, until: Callable[[], T]) -> T:
    """Tick until `until()` is true."""

    def look() -> T:
        cockpit.tick(time.monotonic())
        return until()

    return wait_for(look)


def test_an_idle_teleop_publishes_nothing(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot, Settings(repeat_rate=1000))
    for _ in range(50):
        cockpit.tick(time.monotonic())
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
    cockpit = cockpit_of(wire, robot, Settings(mode=LATCH, repeat_rate=1000))
    press(cockpit, "i")
    for _ in range(3):
        assert tick(cockpit, robot.heard)[0] == Twist.planar(0.5)


def test_with_a_rate_of_zero_only_a_change_is_published(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    for _ in range(100):
        cockpit.tick(time.monotonic())
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
        cockpit.tick(time.monotonic())
    assert cockpit.sent is None


def test_odom_from_before_the_stop_is_no_proof_of_rest(wire: Wire, robot: Robot) -> None:
    """A robot that stood when the key went down has started since."""
    cockpit = cockpit_of(wire, robot)
    see(cockpit, robot, RESTS / 2)
    press(cockpit, "i")
    press(cockpit, "k")
    cockpit.tick(time.monotonic())
    assert cockpit.pilot.engaged


@pytest.mark.parametrize("speed", [(0.02, 0, 0), (0, -0.02, 0), (0, 0, 0.02)])
def test_a_robot_that_moves_in_any_way_does_not_rest(
    wire: Wire, robot: Robot, speed: tuple[float, float, float]
) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "k")
    see(cockpit, robot, *speed)
    cockpit.tick(time.monotonic())
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


@pytest.fixture
def dials_of() -> Iterator[Callable[[Cockpit], Callable[[], State]]]:
    made: list[Dials] = []

    def make(cockpit: Cockpit) -> Callable[[], State]:
        made.append(Dials(cockpit))
        return lambda: made[-1].state("why", time.monotonic(), ascii=False)

    yield make
    for dials in made:
        dials.close()


def test_the_state_shows_the_robot_and_who_drives_it(
    wire: Wire, robot: Robot, dials_of: Callable[[Cockpit], Callable[[], State]]
) -> None:
    cockpit = cockpit_of(wire, robot)
    state = dials_of(cockpit)
    before = state()
    assert (before.robot, before.command, before.odom_age, before.stale) == ("Fred", None, math.inf, True)
    assert (before.speed, before.turn, before.listeners, before.obeyed) == (0.5, 1.0, ["sim"], "")
    robot.status(obeyed="controller@1", held=True, stopped="stop@2", sources=[CommandSource("me", "DATA", 20.0, True)])
    wait_for(lambda: state().obeyed == "controller@1" and state().held)
    assert (state().stopped, state().sources[0].name, state().sources[0].rate) == ("stop@2", "me", 20.0)
    see(cockpit, robot, 0.25)
    assert state().measured == (0.25, 0, 0)
    wait_for(lambda: state().stale)  # the robot says no more
    press(cockpit, "l")
    assert state().command == (0, 0, -1)


def test_the_way_to_the_sim_and_back_is_measured(
    wire: Wire, robot: Robot, dials_of: Callable[[Cockpit], Callable[[], State]]
) -> None:
    state = dials_of(cockpit_of(wire, robot))
    assert state().round_trip is None
    robot.status(obeyed="")
    assert 0 < (wait_for(lambda: state().round_trip) or 0) < 0.2


def test_the_trail_and_the_pace_come_from_odom() -> None:
    track = Track()
    for step in range(200):
        odom = Odometry()
        odom.header.stamp = Time.of(step * 0.01)
        odom.pose.pose.position.x = step * 0.01
        track.see(odom, 100.0 + step * 0.02)
    assert track.real_time_factor() == pytest.approx(0.5)
    assert track.pose == pytest.approx((1.99, 0, 0))
    assert track.trail[0] == (0, 0)
    assert 30 < len(track.trail) < 45
    track.see(Odometry(), 200.0)  # a sim that began anew
    assert len(track.trail) <= 1


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
    assert tick(cockpit, lambda: cockpit.warning) == "every source may drive"
    assert cockpit.sent is None
    resume.append("somebody drives; stop first")
    press(cockpit, "r")
    assert tick(cockpit, lambda: cockpit.warning) == "not handed over: somebody drives; stop first"
    press(cockpit, "q")
    assert cockpit.warning == ""
    assert robot.heard() == []


def test_the_resume_key_stops_the_robot_first(wire: Wire, robot: Robot, resume: list[str]) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    press(cockpit, "r")
    for _ in range(10):
        cockpit.tick(time.monotonic())
    assert cockpit.warning == ""  # not while it moves
    see(cockpit, robot, 0.0)
    assert tick(cockpit, lambda: cockpit.warning) == "every source may drive"
    assert [robot.commands.recv().message for _ in range(2)] == [Twist.planar(0.5), Twist()]


def test_another_key_takes_the_resume_back(wire: Wire, robot: Robot, resume: list[str]) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    press(cockpit, "r")
    press(cockpit, "i")
    for _ in range(10):
        cockpit.tick(time.monotonic())
    assert cockpit.warning == ""
    assert cockpit.sent == Twist.planar(0.5)


def test_without_a_sim_the_resume_key_says_so(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "r")
    told = tick(cockpit, lambda: cockpit.warning)
    assert told.startswith(f"not handed over: no reply from 'Fred/resume' within {RESUME_TIMEOUT} s")


def test_odom_that_comes_no_more_stops_the_robot_until_a_key_is_pressed_anew(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot, Settings(mode=LATCH, repeat_rate=1000))
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    cockpit.tick(time.monotonic())
    robot.heard()
    wait_for(lambda: cockpit.helm.odom.read()[1] > LOST)
    assert tick(cockpit, lambda: cockpit.warning) == BLIND
    assert not any(cockpit.pilot.motion)
    press(cockpit, "J")
    for _ in range(5):
        cockpit.tick(time.monotonic())
    assert cockpit.sent == Twist.planar(0, 0.5), "who wants to drive blind may"


@pytest.mark.parametrize(("stamp", "x"), [(1.0, 0.0), (6.0, 2.0)], ids=["a sim started again", "a robot spawned anew"])
def test_a_robot_that_began_anew_stands_until_a_key_is_pressed_anew(
    wire: Wire, robot: Robot, stamp: float, x: float
) -> None:
    cockpit = cockpit_of(wire, robot)
    wait_for(lambda: robot.odom.matched)
    tell_place(cockpit, robot, 5.0, 0.0)
    press(cockpit, "i")
    tell_place(cockpit, robot, 5.1, 0.05)
    assert any(cockpit.pilot.motion)
    tell_place(cockpit, robot, stamp, x)
    assert not any(cockpit.pilot.motion)
    assert cockpit.warning == ANEW
    press(cockpit, "J")
    assert cockpit.sent == Twist.planar(0, 0.5)


@pytest.mark.parametrize("event", [Focus(False), Unknown("CSI 9 z"), Key("escape")])
def test_a_lost_focus_and_unknown_keys_are_a_stop(wire: Wire, robot: Robot, event: Focus | Unknown | Key) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "i")
    assert robot.commands.recv().message == Twist.planar(0.5)
    assert cockpit.take(event, time.monotonic()) == ""
    assert robot.commands.recv().message == Twist()


@pytest.mark.parametrize("event", [Focus(True), Focus(False), Answer("alive")])
def test_what_is_no_key_says_nothing_while_idle(wire: Wire, robot: Robot, event: Focus | Answer) -> None:
    cockpit = cockpit_of(wire, robot)
    cockpit.take(event, time.monotonic())
    press(cockpit, "i")
    assert robot.commands.recv().message == Twist.planar(0.5)


def test_tab_stops_the_robot_and_goes_to_the_next_one(wire: Wire, robot: Robot) -> None:
    other = robot.bus.subscribe("Ginger/cmd_vel", Twist)
    cockpit = cockpit_of(wire, robot)
    wait_for(lambda: cockpit.ring() == ["Fred", "Ginger"])
    press(cockpit, "i")
    see(cockpit, robot, 0.5)
    press(cockpit, "tab")
    for _ in range(5):
        cockpit.tick(time.monotonic())
    assert cockpit.helm.robot == "Fred", "not while it moves"
    see(cockpit, robot, 0.0)
    tick(cockpit, lambda: cockpit.helm.robot == "Ginger")
    assert other.try_recv() is None, "nothing moves before a new key"
    wait_for(cockpit.listeners)
    press(cockpit, "J")
    assert other.recv().message == Twist.planar(0, 0.5)
    assert set(map(str, robot.heard())) == {str(Twist.planar(0.5)), str(Twist())}


def test_a_key_after_tab_never_moves_the_robot_before(wire: Wire, robot: Robot) -> None:
    other = robot.bus.subscribe("Ginger/cmd_vel", Twist)
    cockpit = cockpit_of(wire, robot)
    wait_for(lambda: cockpit.ring() == ["Fred", "Ginger"])
    press(cockpit, "tab")
    press(cockpit, "i")  # both came at once, over a slow line
    wait_for(lambda: (came := other.try_recv()) and came.message == Twist.planar(0.5))
    assert robot.heard() == []
    press(cockpit, "tab")
    press(cockpit, "J")  # Ginger is not known to rest yet
    press(cockpit, "q")
    assert (cockpit.helm.robot, cockpit.warning) == ("Ginger", ON_THE_WAY)
    tick(cockpit, lambda: cockpit.helm.robot == "Fred")
    assert robot.heard() == []
    assert cockpit.pilot.settings.speed == 0.5
    assert {str(command.message) for command in iter(other.try_recv, None)} == {str(Twist())}


def test_tab_without_another_robot_says_so(wire: Wire, robot: Robot) -> None:
    cockpit = cockpit_of(wire, robot)
    press(cockpit, "tab")
    assert tick(cockpit, lambda: cockpit.warning) == "there is no other robot"


def test_a_robot_may_listen_on_a_key_of_its_own(wire: Wire) -> None:
    bus = wire.bus("sim")
    commands = bus.subscribe("base/my_vel", Twist)
    cockpit = Cockpit(wire.bus("teleop"), [], Pilot(Settings(), TTK), None, "base/my_vel")
    wait_for(cockpit.listeners)
    press(cockpit, "i")
    assert commands.recv().message == Twist.planar(0.5)
    assert (cockpit.helm.status_key, cockpit.helm.beside("resume")) == ("base/my_vel_status", "base/resume")


def test_tab_comes_back_to_a_key_of_its_own(wire: Wire) -> None:
    bus = wire.bus("sim")
    bus.subscribe("base/my_vel", Twist)
    bus.subscribe("Fred/cmd_vel", Twist)
    cockpit = Cockpit(wire.bus("teleop"), [], Pilot(Settings(), TTK), None, "base/my_vel")
    wait_for(lambda: cockpit.ring() == ["Fred", "base"])
    press(cockpit, "tab")
    tick(cockpit, lambda: (cockpit.helm.robot, cockpit.helm.key) == ("Fred", "Fred/cmd_vel"))
    press(cockpit, "tab")
    tick(cockpit, lambda: (cockpit.helm.robot, cockpit.helm.key) == ("base", "base/my_vel"))
