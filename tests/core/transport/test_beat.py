"""Receivers number their own time, senders return the newest number that they have heard."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from threading import Event, Thread
from typing import Any

import pytest
from hypothesis import given
from hypothesis.strategies import binary, from_regex

from holozen.bus import Bus
from holozen.messages import PoseStamped, Twist
from holozen.testing import Wire, wait_for
from holozen.transport.beat import GOAL_BEAT, PERIOD_NS, Beat, OwnTime, beat_key, boot_ns
from holozen.transport.pubsub import Publisher, Subscription
from holozen.transport.samples import Sample, Stamp, stamp_in

FORWARD = Twist.planar(0.3)


@contextmanager
def beating(beat: Beat, after: float = 0.0) -> Iterator[None]:
    """Within this block a loop polls the beat, from so many seconds on."""
    ends = Event()

    def run() -> None:
        ends.wait(after)
        while not ends.wait(0.005):
            beat.poll()

    loop = Thread(target=run)
    loop.start()
    try:
        yield
    finally:
        ends.set()
        loop.join()


class Receiver:
    """A robot that obeys commands on a key."""

    def __init__(self, wire: Wire, key: str = "cmd_vel", name: str = "robot") -> None:
        self.bus: Bus = wire.bus(name, lasting=True)
        self.beat = self.bus.beat()
        self.commands = self.bus.subscribe(key, Twist)

    def stamp(self) -> Stamp:
        """That of the next command."""
        return stamp_of(self.commands)


def stamp_of(commands: Subscription[Any]) -> Stamp:
    """The stamp of the next command there."""
    received = wait_for(commands.try_recv)
    assert received and received.stamp
    return received.stamp


def wait_for_beat(sender: Publisher[Any]) -> None:
    """Wait until a receiver's beat is heard. The first command waits for that too, but not for long
    enough on a busy machine.
    """
    wait_for(lambda: sender.echoes and sender.echoes.heard, what="a beat")


def forward(commands: Publisher[Twist]) -> bool:
    """Send a motion. True."""
    commands.put(FORWARD)
    return True


def test_the_age_is_the_time_since_the_newest_echo_of_ours() -> None:
    times = iter([100, 0])
    own = OwnTime("a", lambda: next(times))
    assert own.age([("a", 150), ("b", 190), ("a", 170)], 200) == pytest.approx(30e-9)
    assert own.age([("a", 200)], 200) == 0.0


def test_an_echo_of_another_session_of_the_future_or_from_before_the_first_beat_tells_no_age() -> (
    None
):
    own = OwnTime("a", lambda: 100)
    for echoes in ([], [("b", 150)], [("a", 201)], [("a", 99)], [("a", 150), ("a", 201)]):
        assert own.age(echoes, 200) is None, echoes


def test_a_receiver_beats_20_times_a_second_and_to_each_who_asks(wire: Wire) -> None:
    robot, other = Receiver(wire), wire.bus()
    key = beat_key(robot.bus.id, "beat")
    heard = other.subscribe_raw(key)
    wait_for(other.served(key))
    now = boot_ns()

    def beats_at(ns: int) -> bool:
        robot.beat.poll(ns)
        return True

    def sent() -> object:
        robot.beat.send(now)
        return heard.try_recv()

    wait_for(sent, what="the way to be known")
    now += 10 * PERIOD_NS
    robot.beat.poll(now)
    robot.beat.poll(now)  # it was late, so the next one is due at once
    for _ in range(2):
        wait_for(lambda: (sample := heard.try_recv()) and int(sample.payload) == now)
    asked = other.ask(key, 60.0)
    answer = wait_for(lambda: beats_at(now + 1) and asked.try_recv())
    assert isinstance(answer, Sample) and answer.payload == b"%d" % (now + 1)
    assert heard.try_recv() is None
    beats = []
    for step in range(1, 201):
        robot.beat.poll(now + step * PERIOD_NS // 10)
        # each is read before the next: Zenoh drops those that its queue cannot hold
        if step % 10 == 0 and (sample := wait_for(heard.try_recv)):
            beats.append(int(sample.payload))
    assert heard.try_recv() is None
    assert {after - before for before, after in pairwise(beats)} == {PERIOD_NS}
    for _ in range(30):
        robot.beat.send(now + 21 * PERIOD_NS)  # events delay no later beat
        wait_for(heard.try_recv)
    robot.beat.poll(now + 22 * PERIOD_NS)
    wait_for(lambda: (sample := heard.try_recv()) and int(sample.payload) == now + 22 * PERIOD_NS)


def test_a_command_returns_the_newest_beats_of_those_alone_who_obey_its_key(wire: Wire) -> None:
    robot, other = Receiver(wire), Receiver(wire, "Fred/cmd_vel", "other")
    commands = wire.bus("driver").publisher("cmd_vel", Twist)
    heard_of_other = other.bus.session.declare_publisher(beat_key(other.bus.id, "beat"))
    with beating(robot.beat), beating(other.beat):
        wait_for(lambda: commands.matched and commands.echoes and commands.echoes.heard)
        assert commands.echoes
        ((_, newest),) = commands.echoes.newest()
        commands.put(FORWARD)
        first = robot.stamp()
        ((session, echoed),) = first.echoes
        assert (session, echoed >= newest) == (robot.bus.id, True)
        assert robot.beat.own.age(first.echoes) is not None
        wait_for(lambda: forward(commands) and robot.stamp().echoes[0][1] > first.echoes[0][1])
        assert not heard_of_other.matching_status.matching
        late = Receiver(wire, name="late")  # found by its token
        with beating(late.beat):
            both = {robot.bus.id, late.bus.id}
            wait_for(
                lambda: (
                    forward(commands) and {session for session, _ in robot.stamp().echoes} == both
                )
            )
        late.bus.close()
        wait_for(
            lambda: (
                forward(commands)
                and [session for session, _ in robot.stamp().echoes] == [robot.bus.id]
            )
        )


def test_without_a_beat_only_stops_are_sent_which_is_reported(
    wire: Wire, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, driver = Receiver(wire), wire.bus("driver")
    commands = driver.publisher("cmd_vel", Twist)
    wait_for(lambda: commands.matched and commands.echoes and commands.echoes.has_receiver)
    commands.put(Twist())
    assert robot.stamp() == Stamp(driver.id, 0, (), "driver")
    wait_for(lambda: forward(commands) and "waiting for the robot" in capsys.readouterr().err)
    commands.put(Twist())
    assert robot.stamp() == Stamp(driver.id, 1, (), "driver")
    with beating(robot.beat):
        wait_for(lambda: forward(commands) and robot.commands.try_recv())
    assert commands.echoes and commands.echoes.heard
    assert capsys.readouterr().err == ""


def test_who_waits_again_hears_a_receiver_that_came_meanwhile(wire: Wire) -> None:
    sender = wire.bus("sender").publisher("cmd_vel", Twist)
    assert sender.echoes
    sender.echoes.settle()
    robot = Receiver(wire)
    wait_for(lambda: sender.matched, what="a link")
    with beating(robot.beat, after=0.2):
        sender.echoes.settle(10.0)
        assert sender.echoes.heard


@pytest.mark.parametrize("late", ["sub", "beat"])
def test_who_subscribes_and_is_not_known_yet_is_waited_for(wire: Wire, late: str) -> None:
    robot, driver = wire.bus("robot"), wire.bus("driver")
    commands, ends = driver.publisher("cmd_vel", Twist), Event()
    assert commands.echoes
    announcing: dict[str, Callable[[], object]] = {
        "sub": lambda: robot.announce("sub", "geometry_msgs/msg/Twist", "cmd_vel"),
        "beat": robot.beat,
    }
    tokens = [announce() for kind, announce in announcing.items() if kind != late]
    robot.subscribe_raw("cmd_vel")
    wait_for(lambda: commands.matched, what="a match")

    def tell() -> None:
        """Announce the other while the driver waits."""
        ends.wait(0.2)
        tokens.append(announcing[late]())
        with beating(robot.beat()):
            ends.wait()

    telling = Thread(target=tell)
    telling.start()
    commands.echoes.settle(10.0)
    heard = commands.echoes.heard
    ends.set()
    telling.join()
    assert heard


def test_who_has_a_match_knows_of_whom_to_expect_a_beat(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, driver = wire.bus("robot", lasting=True), wire.bus("driver")
    commands, begins = driver.publisher("cmd_vel", Twist), Event()
    wait_for(driver.connected, what="a link")
    announce = robot.announce

    def late(kind: str, *of: str) -> object:
        """Announce a subscription when Zenoh has had time to tell of it."""
        if kind == "sub":
            begins.set()
            with suppress(AssertionError):
                wait_for(lambda: commands.matched, 0.3)
        return announce(kind, *of)

    monkeypatch.setattr(robot, "announce", late)
    robot.beat()
    subscribing = Thread(target=robot.subscribe, args=("cmd_vel", Twist))
    subscribing.start()
    wait_for(lambda: begins.is_set() and commands.matched, what="a match")
    assert commands.echoes and commands.echoes.has_receiver
    subscribing.join()


def test_commands_are_numbered_from_the_first_that_a_robot_may_have_heard(wire: Wire) -> None:
    """Of those before it the robot has missed none, so their source need not let go."""
    commands = wire.bus("driver").publisher("cmd_vel", Twist)
    for _ in range(3):
        commands.put(FORWARD)
    robot = Receiver(wire)
    with beating(robot.beat):
        wait_for(lambda: commands.echoes and commands.echoes.has_receiver and commands.echoes.heard)
        for _ in range(2):
            commands.put(FORWARD)
        numbered = [robot.stamp(), robot.stamp()]
    assert [(stamp.number, bool(stamp.echoes)) for stamp in numbered] == [(0, True), (1, True)]


def test_who_reads_commands_and_does_not_beat_gets_all(wire: Wire) -> None:
    reader, driver = wire.bus("reader").subscribe("cmd_vel", Twist), wire.bus("driver")
    commands = driver.publisher("cmd_vel", Twist)
    wait_for(lambda: commands.matched)
    commands.put(FORWARD)
    assert stamp_of(reader) == Stamp(driver.id, 0, (), "driver")


def test_a_command_that_waited_is_dated_back_and_the_next_is_no_older(wire: Wire) -> None:
    robot = Receiver(wire)
    commands = wire.bus("driver").publisher("cmd_vel", Twist)
    with beating(robot.beat):
        wait_for_beat(commands)
        commands.put(FORWARD)
        robot.stamp()
    robot.beat.send(newest := boot_ns())  # the last that is sent
    session, echoes = robot.bus.id, commands.echoes
    wait_for(lambda: echoes and echoes.newest() == ((session, newest),))
    made = []
    for waited in (0.2, 0.1, 0.3):
        commands.put(FORWARD, waited)
        made.append(robot.stamp().echoes)
    assert made == [((session, newest - ns),) for ns in (200_000_000, 100_000_000, 100_000_000)]


def test_goals_return_the_beat_of_those_who_drive_to_goals(wire: Wire) -> None:
    pilot = wire.bus("controller", lasting=True)
    beat, goals = pilot.beat(GOAL_BEAT), pilot.subscribe("goal_pose", PoseStamped)
    setter = wire.bus("setter").publisher("goal_pose", PoseStamped)
    with beating(beat):
        wait_for_beat(setter)
        setter.put(PoseStamped())
    age = beat.own.age(stamp_of(goals).echoes)
    assert age is not None and age < 60.0


def test_a_stamp_is_read_from_an_attachment() -> None:
    for echoes, read in (
        (b"", ()),
        (b"a:1", (("a", 1),)),
        (b"0a9f:12,b:3", (("0a9f", 12), ("b", 3))),
    ):
        for end in (b"", b";signature"):
            assert stamp_in(b"node@abc;7;" + echoes + end) == Stamp("abc", 7, read, "node")


@given(
    binary(max_size=80)
    | from_regex(rb"n@[0-9a-z]{0,3};[0-9]{0,3};[0-9a-f]{0,2}:?[0-9]{0,3},?", fullmatch=True)
)
def test_whatever_an_attachment_holds_its_stamp_is_whole_or_none(attachment: bytes) -> None:
    stamp = stamp_in(attachment)
    if stamp is not None:
        assert stamp.session.isalnum() and stamp.number >= 0
        assert all(session and ns >= 0 for session, ns in stamp.echoes)
    if re.fullmatch(rb"n@[0-9a-z]{1,3};[0-9]+;([0-9a-f]+:[0-9]+)?", attachment):
        assert stamp is not None
