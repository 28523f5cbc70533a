"""The session on a real bus: keys are published at once, a stop until the robot rests, and
otherwise nothing.
"""

import gc
import itertools
import math
import weakref
from collections.abc import Callable
from typing import TypeVar

import pytest

from holozen.bus import Bus
from holozen.messages import (
    CommandSource,
    CommandStatus,
    Header,
    LaserScan,
    Odometry,
    SimulationStatus,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    TriggerReply,
    TriggerRequest,
    Twist,
    TwistStamped,
    Vector3,
)
from holozen.messages.simulation_interfaces import SimulationState
from holozen.odometry import LOST, RESTS
from holozen.testing import Wire, wait_for
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.pubsub import Publisher, Subscription
from services.teleop.control.key_state import LATCH
from services.teleop.control.layouts import TTK
from services.teleop.control.twist_mapper import Settings, TwistMapper
from services.teleop.input.kitty import Answer, Focus, Key, Unknown
from services.teleop.session import BLIND, RESET, RESUME_TIMEOUT, SWITCHING, RobotClient, Session
from services.teleop.telemetry import Refusals, Telemetry, Track
from services.teleop.view import State
from tests.core.teleop.paced import now, set_pace

T = TypeVar("T")


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """The teleop gives up after a second what it waits for, which a busy machine may take away."""
    set_pace(monkeypatch)


class Robot:
    """The other side: what arrives on cmd_vel, and the odom that it publishes."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.commands: Subscription[Twist | TwistStamped] = bus.subscribe(
            "Fred/cmd_vel", Twist, TwistStamped
        )
        self.odom: Publisher[Odometry] = bus.publisher("Fred/odom", Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher("Fred/cmd_vel_status", CommandStatus)

    def publish(self, x: float, y: float = 0.0, turn: float = 0.0) -> None:
        odom = Odometry()
        odom.twist.twist = Twist.planar(x, y, turn)
        self.odom.put(odom)

    def status(self, **fields: object) -> None:
        self._status.put(CommandStatus(**fields))  # type: ignore[arg-type]

    def is_heard(self) -> bool:
        """Whether the session receives what the robot publishes from now on."""
        return self.odom.matched and self._status.matched

    def heard(self) -> list[Twist | TwistStamped | None]:
        return [received.message for received in iter(self.commands.try_recv, None)]


@pytest.fixture
def robot(wire: Wire) -> Robot:
    return Robot(wire.bus("sim"))


def session_of(
    wire: Wire, robot: Robot, settings: Settings | None = None, stamped: str | None = None
) -> Session:
    mapper = TwistMapper(settings or Settings(mode=LATCH, repeat_rate=0), TTK)
    session = Session(wire.bus("teleop"), ["Fred"], mapper, stamped)
    wait_for_listeners(session)
    wait_for(robot.is_heard)
    return session


def wait_for_listeners(session: Session) -> None:
    """Wait until somebody is listed as a listener, and receives what the session sends from now
    on.
    """
    wait_for(session.listeners)
    publisher = session.bus.session.declare_publisher(session.client.key)
    wait_for(lambda: publisher.matching_status.matching)


def see(session: Session, robot: Robot, x: float, y: float = 0.0, turn: float = 0.0) -> None:
    """Have the robot publish its speed once, and wait until the session has it."""
    wait_for(lambda: robot.odom.matched)
    before = session.client.odom.count
    robot.publish(x, y, turn)
    wait_for(lambda: session.client.odom.count > before)


def publish_place(session: Session, robot: Robot, stamp: float, x: float) -> None:
    """Have the robot publish its pose at a time, and the session look at it."""
    odom, before = Odometry(), session.client.odom.count
    odom.header.stamp, odom.pose.pose.position.x = Time.of(stamp), x
    robot.odom.put(odom)
    wait_for(lambda: session.client.odom.count > before)
    session.tick(now())


def press(session: Session, key: str) -> None:
    """Type a key, in a terminal that reports no releases."""
    session.take(Key(key, key), now())


def tick(session: Session, until: Callable[[], T]) -> T:
    """Tick until `until()` is true."""

    def look() -> T:
        session.tick(now())
        return until()

    return wait_for(look)


def test_an_idle_teleop_publishes_nothing(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot, Settings(repeat_rate=1000))
    for _ in range(50):
        session.tick(now())
    press(session, "q")
    session.let_go()
    session.halt()
    press(session, "i")
    assert robot.commands.recv().message == Twist.planar(0.55)  # and nothing before it


def test_a_key_is_published_at_once_with_the_priority_of_a_person(wire: Wire, robot: Robot) -> None:
    press(session_of(wire, robot), "J")
    received = robot.commands.recv()
    assert received.message == Twist.planar(0, 0.5)
    assert received.priority == "INTERACTIVE_HIGH"
    assert received.source.startswith("teleop@")


def test_a_key_that_drives_is_repeated_at_its_rate(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot, Settings(mode=LATCH, repeat_rate=1000))
    press(session, "i")
    for _ in range(3):
        assert tick(session, robot.heard)[0] == Twist.planar(0.5)


def test_with_a_rate_of_zero_only_a_change_is_published(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot)
    press(session, "i")
    for _ in range(100):
        session.tick(now())
    press(session, "j")
    assert [robot.commands.recv().message for _ in range(2)] == [
        Twist.planar(0.5),
        Twist.planar(turn=1.0),
    ]


def test_a_key_that_timed_out_is_a_stop(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot, Settings(key_timeout=0.01, repeat_rate=0))
    press(session, "i")
    assert robot.commands.recv().message == Twist.planar(0.5)
    assert tick(session, robot.heard)[0] == Twist()


@pytest.mark.parametrize("rate", [0.0, 0.01])
def test_a_stop_is_repeated_until_odom_that_is_newer_shows_rest(
    wire: Wire, robot: Robot, rate: float
) -> None:
    session = session_of(wire, robot, Settings(mode=LATCH, repeat_rate=rate))
    press(session, "i")
    see(session, robot, 0.5)
    press(session, "k")
    tick(session, lambda: Twist() in robot.heard())
    assert tick(session, robot.heard)[0] == Twist()  # the robot still moves
    see(session, robot, RESTS / 2)
    tick(session, lambda: not session.mapper.engaged)
    robot.heard()
    for _ in range(20):
        session.tick(now())
    assert session.sent is None


def test_odom_from_before_the_stop_is_no_proof_of_rest(wire: Wire, robot: Robot) -> None:
    """A robot that stood when the key went down has started since."""
    session = session_of(wire, robot)
    see(session, robot, RESTS / 2)
    press(session, "i")
    press(session, "k")
    session.tick(now())
    assert session.mapper.engaged


def test_rest_counts_once_the_robot_can_have_heard_the_stop(wire: Wire, robot: Robot) -> None:
    """What arrives sooner over a slow link may have been sent before the robot began to move."""
    session = session_of(wire, robot)
    press(session, "i")
    press(session, "k")
    stopped = session.mapper.stopping_since()
    assert stopped is not None

    def rests(*sources: CommandSource) -> bool:
        robot.status(sources=list(sources))
        wait_for(lambda: session.client.status().sources == list(sources))
        see(session, robot, RESTS / 2)
        session.publish(stopped)
        return not session.mapper.engaged

    assert not rests(CommandSource("another@1", delay=0.01)), "it has heard nothing of us"
    assert not rests(CommandSource(session.bus.source, delay=60.0)), "it hears us a minute late"
    assert rests(CommandSource(session.bus.source, delay=1e-6))


def test_a_robot_that_moves_in_any_way_does_not_rest(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot)
    for speed in [(0.02, 0, 0), (0, -0.02, 0), (0, 0, 0.02)]:
        press(session, "k")
        see(session, robot, *speed)
        session.tick(now())
        assert session.mapper.engaged, speed


def test_halt_stops_a_robot_and_returns_when_it_rests(
    wire: Wire, robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_pace(monkeypatch, sleep=now.sleep)
    session = session_of(wire, robot)
    press(session, "i")
    see(session, robot, 0.5)
    wait_for(robot.heard)
    session.halt()  # no odom reports rest: given up after a second
    assert not session.mapper.engaged
    heard = list[Twist | TwistStamped | None]()

    def heard_many() -> bool:
        heard.extend(robot.heard())
        return len(heard) > 10

    wait_for(heard_many)
    assert set(map(str, heard)) == {str(Twist())}


def test_a_robot_that_is_left_leaves_no_reader_in_the_bus(wire: Wire) -> None:
    with wire.bus("teleop") as bus:
        client = RobotClient(bus, "Fred", "", None)
        readers = [
            weakref.ref(latest.raw) for latest in (client.odom, bus.latest("kept", Odometry))
        ]
        client.close()
        del client
        wait_for(
            lambda: gc.collect() is not None and readers[0]() is None,
            what="the reader of odom to be gone",
        )
        assert readers[1]() is not None, "the bus keeps those that are in use"


def test_stamped_commands_have_the_time_and_the_frame(wire: Wire, robot: Robot) -> None:
    press(session_of(wire, robot, stamped="base_link"), "i")
    message = robot.commands.recv().message
    assert isinstance(message, TwistStamped)
    assert message.twist == Twist.planar(0.5)
    assert message.header.frame_id == "base_link"
    assert message.header.stamp.seconds() > 1.7e9


@pytest.fixture
def telemetry_of() -> Callable[[Session], Callable[[], State]]:
    def make(session: Session) -> Callable[[], State]:
        telemetry = Telemetry(session)
        return lambda: telemetry.state("why", now(), ascii=False)

    return make


def test_the_state_shows_the_robot_and_its_driver(
    wire: Wire, robot: Robot, telemetry_of: Callable[[Session], Callable[[], State]]
) -> None:
    session = session_of(wire, robot)
    state = telemetry_of(session)
    before = state()
    assert (before.robot, before.command, before.odom_age, before.stale) == (
        "Fred",
        None,
        math.inf,
        True,
    )
    assert (before.speed, before.turn, before.listeners, before.obeyed) == (0.5, 1.0, ["sim"], "")
    robot.status(
        obeyed="controller@1",
        held=True,
        stopped="stop@2",
        sources=[CommandSource("me", "DATA", 20.0, True)],
    )
    wait_for(lambda: state().obeyed == "controller@1" and state().held)
    assert (state().stopped, state().sources[0].name, state().sources[0].rate) == (
        "stop@2",
        "me",
        20.0,
    )
    see(session, robot, 0.25)
    assert state().measured == (0.25, 0, 0)
    wait_for(lambda: state().stale)  # the robot publishes no more
    press(session, "l")
    assert state().command == (0, 0, -1)


def test_who_drives_is_told_what_slows_the_robot_down(
    wire: Wire, robot: Robot, telemetry_of: Callable[[Session], Callable[[], State]]
) -> None:
    session = session_of(wire, robot)
    state = telemetry_of(session)
    limited = "slowed: 0.4 m to the left"
    robot.status(obeyed=session.bus.source, limited=limited)
    wait_for(lambda: state().warning == limited)
    robot.status(obeyed="another@2", limited=limited)
    wait_for(lambda: state().obeyed == "another@2")
    assert state().warning == ""
    robot.status(obeyed=session.bus.source)
    wait_for(lambda: state().obeyed == session.bus.source)
    assert state().warning == ""


def test_a_robot_that_cannot_strafe_has_no_keys_for_that(
    wire: Wire, robot: Robot, telemetry_of: Callable[[Session], Callable[[], State]]
) -> None:
    session = session_of(wire, robot)
    state = telemetry_of(session)
    assert "J/L strafe" in " ".join(state().keys)
    robot.status(strafes=False)
    wait_for(lambda: state().keys == TTK.without_strafing.help)
    session.help = True
    assert state().keys == TTK.without_strafing.table


def test_what_its_lidar_sees_is_shown_where_it_is(
    wire: Wire, robot: Robot, telemetry_of: Callable[[Session], Callable[[], State]]
) -> None:
    state = telemetry_of(session_of(wire, robot))
    scans = robot.bus.publisher("Fred/scan", LaserScan)
    frames = robot.bus.publisher("Fred/tf", TFMessage)
    lidar = TransformStamped(
        Header(frame_id="base"), "lidar", Transform(translation=Vector3(1.0, 2.0, 0.0))
    )
    scan = LaserScan(Header(frame_id="lidar"), range_max=9.0, ranges=[3.0, math.inf])

    def sees() -> bool:
        robot.odom.put(Odometry(Header(frame_id="odom"), "base"))
        frames.put(TFMessage([lidar]))
        scans.put(scan)
        return bool(state().seen)

    wait_for(sees)
    (point,) = state().seen
    assert point == pytest.approx((4.0, 2.0))


def test_a_paused_sim_is_shown_until_it_goes_on_or_says_no_more(
    wire: Wire, robot: Robot, telemetry_of: Callable[[Session], Callable[[], State]]
) -> None:
    sim = robot.bus.publisher("simulation_status", SimulationStatus)
    state = telemetry_of(session_of(wire, robot))
    assert not state().paused

    def publish(number: int) -> bool:
        sim.put(SimulationStatus(number))
        return state().paused

    wait_for(lambda: publish(SimulationState.STATE_PAUSED))
    wait_for(lambda: not publish(SimulationState.STATE_PLAYING))
    wait_for(lambda: publish(SimulationState.STATE_PAUSED))
    wait_for(lambda: not state().paused)  # the sim publishes no more


def test_the_way_to_the_sim_and_back_is_the_age_of_what_our_commands_return(
    wire: Wire, robot: Robot, telemetry_of: Callable[[Session], Callable[[], State]]
) -> None:
    session = session_of(wire, robot)
    state = telemetry_of(session)
    assert state().round_trip is None
    robot.status(
        sources=[CommandSource("other@1", delay=0.9), CommandSource(session.bus.source, delay=0.2)]
    )
    assert wait_for(lambda: state().round_trip) == 0.2


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
    track.see(Odometry(), 200.0)  # a sim that started again
    assert len(track.trail) <= 1


def test_a_refusal_is_shown_until_a_later_command_is_accepted() -> None:
    refusals, ours, others = Refusals(), "me@1: held: x", "you@2: old: y"
    once = CommandStatus(refused={"held": 1}, last_refusal=ours)
    assert [refusals.see(status, "me@1") for status in (CommandStatus(), once, once)] == [
        "",
        "held: x",
        "held: x",
    ]
    again = CommandStatus(refused={"held": 2}, last_refusal=ours, accepted=1)
    assert refusals.see(again, "me@1") == "held: x", "one was accepted, and one refused"
    assert (
        refusals.see(CommandStatus(refused={"held": 2}, last_refusal=ours, accepted=2), "me@1")
        == ""
    )
    assert (
        refusals.see(
            CommandStatus(refused={"held": 2, "old": 1}, last_refusal=others, accepted=2), "me@1"
        )
        == ""
    )


@pytest.fixture
def resume(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Serves `resume`; a reason in the list is the next refusal."""
    monkeypatch.setattr("services.teleop.session.RESUME_TIMEOUT", 30.0)
    reasons: list[str] = []

    def answer(_request: TriggerRequest) -> TriggerReply:
        if reasons:
            raise ServiceError(reasons.pop())
        return TriggerReply(True, "every source may drive")

    robot.bus.serve("Fred/resume", TriggerRequest, TriggerReply, answer).start()
    return reasons


def test_the_resume_key_asks_the_sim_and_shows_its_answer(
    wire: Wire, robot: Robot, resume: list[str]
) -> None:
    session = session_of(wire, robot)
    press(session, "r")
    assert tick(session, lambda: session.warning) == "every source may drive"
    assert session.sent is None
    resume.append("somebody drives; stop it first")
    press(session, "r")
    assert (
        tick(session, lambda: session.warning) == "not handed over: somebody drives; stop it first"
    )
    press(session, "q")
    assert session.warning == ""
    assert robot.heard() == []


def test_the_resume_key_stops_the_robot_first(wire: Wire, robot: Robot, resume: list[str]) -> None:
    session = session_of(wire, robot)
    press(session, "i")
    see(session, robot, 0.5)
    press(session, "r")
    for _ in range(10):
        session.tick(now())
    assert session.warning == ""  # not while it moves
    see(session, robot, 0.0)
    assert tick(session, lambda: session.warning) == "every source may drive"
    assert [robot.commands.recv().message for _ in range(2)] == [Twist.planar(0.5), Twist()]


def test_another_key_takes_the_resume_back(wire: Wire, robot: Robot, resume: list[str]) -> None:
    session = session_of(wire, robot)
    press(session, "i")
    see(session, robot, 0.5)
    press(session, "r")
    press(session, "i")
    for _ in range(10):
        session.tick(now())
    assert session.warning == ""
    assert session.sent == Twist.planar(0.5)


def test_steering_takes_the_resume_back(wire: Wire, robot: Robot, resume: list[str]) -> None:
    session = session_of(wire, robot)
    press(session, "i")
    see(session, robot, 0.5)
    session.act("resume", now())
    session.steer((1.0, 0.0, 0.0), now())
    session.steer((0.0, 0.0, 0.0), now())
    session.halt()
    see(session, robot, 0.0)
    for _ in range(10):
        session.tick(now())
    assert session.warning == ""


def test_without_a_sim_the_resume_key_reports_that(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot)
    press(session, "r")
    expected = tick(session, lambda: session.warning)
    assert expected.startswith(
        f"not handed over: no reply from 'Fred/resume' within {RESUME_TIMEOUT} s"
    )


def test_without_odom_the_robot_stops_until_a_key_is_pressed_again(
    wire: Wire, robot: Robot
) -> None:
    session = session_of(wire, robot, Settings(mode=LATCH, repeat_rate=1000))
    press(session, "i")
    see(session, robot, 0.5)
    session.tick(now())
    robot.heard()
    wait_for(lambda: session.client.odom.read()[1] > LOST)
    assert tick(session, lambda: session.warning) == BLIND
    assert not any(session.mapper.motion)
    press(session, "J")
    for _ in range(5):
        session.tick(now())
    assert session.sent == Twist.planar(0, 0.5), "driving without odom is allowed"


def test_a_robot_that_was_replaced_stands_until_a_key_is_pressed_again(
    wire: Wire, robot: Robot
) -> None:
    session = session_of(wire, robot, Settings(mode=LATCH, repeat_rate=1000))
    see(session, robot, 0.0)
    press(session, "i")
    see(session, robot, 0.5)
    robot.odom.close()
    robot.odom = robot.bus.publisher("Fred/odom", Odometry)

    def seen() -> str:
        robot.publish(0.0)  # the new one is never silent
        return session.warning

    assert tick(session, seen) == BLIND
    assert not any(session.mapper.motion)
    press(session, "J")
    session.tick(now())
    assert session.sent == Twist.planar(0, 0.5)


@pytest.mark.parametrize(
    ("stamp", "x"), [(1.0, 0.0), (6.0, 2.0)], ids=["a sim started again", "a robot spawned again"]
)
def test_a_robot_that_started_again_stands_until_a_key_is_pressed_again(
    wire: Wire, robot: Robot, stamp: float, x: float
) -> None:
    session = session_of(wire, robot)
    wait_for(lambda: robot.odom.matched)
    publish_place(session, robot, 5.0, 0.0)
    press(session, "i")
    publish_place(session, robot, 5.1, 0.05)
    assert any(session.mapper.motion)
    publish_place(session, robot, stamp, x)
    assert not any(session.mapper.motion)
    assert session.warning == RESET
    press(session, "J")
    assert session.sent == Twist.planar(0, 0.5)


def test_a_robot_that_was_reset_near_its_start_stands_until_a_key_is_pressed_again(
    wire: Wire, robot: Robot
) -> None:
    session, sim = (
        session_of(wire, robot),
        robot.bus.publisher("simulation_status", SimulationStatus),
    )
    epochs = itertools.count()

    def seen() -> bool:
        sim.put(SimulationStatus(epoch=next(epochs)))
        publish_place(session, robot, 5.0, 0.0)
        return session.warning == RESET

    press(session, "i")
    assert any(session.mapper.motion)
    wait_for(seen, what="the reset to be seen")
    assert not any(session.mapper.motion)


def test_a_lost_focus_and_unknown_keys_are_a_stop(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot)
    for event in (Focus(False), Unknown("CSI 9 z"), Key("escape")):
        press(session, "i")
        assert robot.commands.recv().message == Twist.planar(0.5), event
        assert session.take(event, now()) == ""
        assert robot.commands.recv().message == Twist(), event


def test_an_unmapped_key_publishes_nothing_while_idle(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot)
    for event in (Focus(True), Focus(False), Answer("alive")):
        session.take(event, now())
    press(session, "i")
    assert robot.commands.recv().message == Twist.planar(0.5)


def test_tab_stops_the_robot_and_goes_to_the_next_one(wire: Wire, robot: Robot) -> None:
    other = robot.bus.subscribe("Ginger/cmd_vel", Twist)
    session = session_of(wire, robot)
    wait_for(lambda: session.ring() == ["Fred", "Ginger"])
    press(session, "i")
    see(session, robot, 0.5)
    press(session, "tab")
    for _ in range(5):
        session.tick(now())
    assert session.client.robot == "Fred", "not while it moves"
    see(session, robot, 0.0)
    tick(session, lambda: session.client.robot == "Ginger")
    assert other.try_recv() is None, "nothing moves before a new key"
    wait_for_listeners(session)
    press(session, "J")
    assert other.recv().message == Twist.planar(0, 0.5)
    assert set(map(str, robot.heard())) == {str(Twist.planar(0.5)), str(Twist())}


def test_a_key_after_tab_never_moves_the_robot_before(wire: Wire, robot: Robot) -> None:
    other = robot.bus.subscribe("Ginger/cmd_vel", Twist)
    session = session_of(wire, robot)
    wait_for(lambda: session.ring() == ["Fred", "Ginger"])
    press(session, "tab")
    press(session, "i")  # both came at once, over a slow line
    wait_for(lambda: (came := other.try_recv()) and came.message == Twist.planar(0.5))
    assert robot.heard() == []
    press(session, "tab")
    press(session, "J")  # Ginger is not known to rest yet
    press(session, "q")
    assert (session.client.robot, session.warning) == ("Ginger", SWITCHING)
    tick(session, lambda: session.client.robot == "Fred")
    assert robot.heard() == []
    assert session.mapper.settings.speed == 0.5
    assert {str(command.message) for command in iter(other.try_recv, None)} == {str(Twist())}


def test_tab_passes_over_forged_names(wire: Wire, robot: Robot) -> None:
    forged = ("**/cmd_vel", "a b/cmd_vel", "Fred/arm/cmd_vel", "9/cmd_vel", "Ginger/cmd_vel")
    _tokens = [robot.bus.announce("sub", Twist.ROS, key) for key in forged]
    session = session_of(wire, robot)
    wait_for(lambda: session.ring() == ["Fred", "Ginger"])


def test_a_robot_that_cannot_be_driven_leaves_the_one_before(wire: Wire, robot: Robot) -> None:
    session = Session(wire.bus("teleop"), ["Fred", "no//key"], TwistMapper(Settings(), TTK), None)
    wait_for(session.listeners)
    press(session, "tab")
    with pytest.raises(BusError):
        tick(session, lambda: False)
    assert session.client.robot == "Fred"
    press(session, "i")
    assert robot.commands.recv().message == Twist.planar(0.5)


def test_tab_without_another_robot_reports_it(wire: Wire, robot: Robot) -> None:
    session = session_of(wire, robot)
    press(session, "tab")
    assert tick(session, lambda: session.warning) == "there is no other robot"


def test_a_robot_may_listen_on_a_key_of_its_own(wire: Wire) -> None:
    bus = wire.bus("sim")
    commands = bus.subscribe("base/my_vel", Twist)
    session = Session(wire.bus("teleop"), [], TwistMapper(Settings(), TTK), None, "base/my_vel")
    wait_for_listeners(session)
    press(session, "i")
    assert commands.recv().message == Twist.planar(0.5)
    assert (session.client.status_key, session.client.beside("resume")) == (
        "base/my_vel_status",
        "base/resume",
    )


@pytest.mark.parametrize("key", ["cmd_vel", "hb_bot/cmd_vel"])
def test_the_robot_at_the_root_goes_by_its_name_unless_another_has_it(wire: Wire, key: str) -> None:
    bus = wire.bus("sim")
    commands, status = bus.subscribe(key, Twist), bus.publisher("cmd_vel_status", CommandStatus)
    session = Session(wire.bus("teleop"), ["hb_bot"], TwistMapper(Settings(), TTK), None)
    wait_for(lambda: [end for end in session.graph.endpoints() if end.key == key])
    seen = session.bus.latest("cmd_vel_status", CommandStatus)

    def look() -> bool:
        status.put(CommandStatus(name="hb_bot"))
        return seen.count > 10

    tick(session, look)
    wait_for_listeners(session)
    press(session, "i")
    assert commands.recv().message == Twist.planar(0.5)


def test_tab_comes_back_to_a_key_of_its_own(wire: Wire) -> None:
    bus = wire.bus("sim")
    bus.subscribe("base/my_vel", Twist)
    bus.subscribe("Fred/cmd_vel", Twist)
    session = Session(wire.bus("teleop"), [], TwistMapper(Settings(), TTK), None, "base/my_vel")
    wait_for(lambda: session.ring() == ["Fred", "base"])
    press(session, "tab")
    tick(session, lambda: (session.client.robot, session.client.key) == ("Fred", "Fred/cmd_vel"))
    press(session, "tab")
    tick(session, lambda: (session.client.robot, session.client.key) == ("base", "base/my_vel"))
