"""Round trips bound how far apart two clocks are; what arrives fast refines that, and nothing else does."""

import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from holozen.messages import Twist
from holozen.testing import Wire, wait_for
from holozen.transport.errors import BusError
from holozen.transport.peer_clocks import AGAIN, MAX_PEERS, PeerClocks, clock_key
from holozen.transport.samples import Sample, Stamp

OFFSET = 7200.0  # s that the peer's clock is ahead of ours


class Link:
    """A peer behind a link with delays in seconds there and back, and this side's clock."""

    def __init__(self, there: float = 0.0, back: float = 0.0) -> None:
        self.now, self.there, self.back = 100.0, there, back
        self.alive, self.asked, self.offset = True, 0, OFFSET
        self.silent = False  # requests from now on are never answered
        self.clocks = PeerClocks(self.ask, lambda session: self.alive or session != "aa", lambda: self.now)
        self.clocks.track(["aa"], self.now)

    def ask(self, _session: str, _nonce: bytes, _timeout: float) -> "Reply":
        self.asked += 1
        return Reply(self, self.now)

    def run(self, seconds: float) -> None:
        """Look every 4 ms, as a sim does."""
        for _ in range(round(seconds / 0.004)):
            self.clocks.poll(self.now)
            self.now += 0.004

    def ages(self, age: float) -> tuple[float, float] | None:
        """What is known of the age of a sample that was sent `age` seconds ago."""
        return self.clocks.ages("aa", self.now - age + self.offset, self.now)


class Reply:
    """The answer of the peer, which is on its way for as long as the link takes."""

    def __init__(self, link: Link, asked: float) -> None:
        self.link, self.comes = link, asked + link.there + link.back + 1e9 * link.silent
        self.clock = round((asked + link.there + link.offset) * 1e9)

    def try_recv(self) -> Sample | bytes | None:
        if not self.link.alive:
            raise BusError("no more replies")
        if self.link.now < self.comes:
            return None
        return Sample(SimpleNamespace(payload=zenoh.ZBytes(str(self.clock)), encoding=""))


def test_without_an_answer_nothing_is_known() -> None:
    link = Link(0.02, 0.02)
    link.run(0.03)
    assert link.ages(0.0) is None
    assert link.clocks.answered("aa") < 0
    link.run(0.03)
    assert link.ages(0.0) is not None
    assert link.clocks.answered("aa") == pytest.approx(100.0)


def test_a_first_round_trip_that_was_held_up_makes_no_waiting_command_prompt() -> None:
    link = Link(0.0, 0.4)
    link.run(0.3)
    link.back = 0.0  # the link is restored: what waited comes at once
    for _ in range(50):
        link.run(0.004)
        if known := link.ages(0.4):
            break
    assert known == pytest.approx((0.4, 0.4), abs=0.02)
    assert link.now > 100.4


@given(there=st.floats(0, 2), back=st.floats(0, 2), age=st.floats(0, 5), runs=st.floats(0.1, 3))
def test_the_true_age_lies_within_the_bounds_and_their_width_is_that_of_the_round_trip(
    there: float, back: float, age: float, runs: float
) -> None:
    link = Link(there, back)
    link.run(2 * (there + back) + runs)
    known = link.ages(age)
    assert known is not None
    youngest, oldest = known
    assert youngest - 1e-6 <= age <= oldest + 1e-6
    assert oldest - age <= there + 0.02  # the way there, and what a clock may drift between two round trips


def test_a_fast_sample_refines_the_lower_bound_and_no_sample_the_upper_one() -> None:
    link = Link(0.3, 0.3)
    link.run(1.3)
    first = link.ages(0.3)
    assert first == pytest.approx((0.0, 0.6), abs=0.01)
    assert link.ages(0.001) == pytest.approx((0.0, 0.301), abs=0.01)
    assert link.ages(0.3) == pytest.approx((0.299, 0.6), abs=0.01)


def test_a_sample_from_the_future_proves_nothing_and_asks_for_another_round_trip() -> None:
    link = Link()
    link.run(2.0)
    before, asked = link.ages(0.1), link.asked
    assert link.ages(-5.0) is None
    assert link.ages(0.1) == before
    link.run(0.01)
    assert link.asked > asked


def test_a_sample_that_comes_while_others_are_read_has_an_age() -> None:
    link = Link()
    link.run(2.0)
    began = link.now
    link.now += 0.01
    assert link.clocks.ages("aa", link.now + link.offset, began) == pytest.approx((0.0, 0.0), abs=0.005)
    assert link.ages(0.0) == pytest.approx((0.0, 0.0), abs=0.005)


def test_a_clock_that_jumped_is_measured_again() -> None:
    link = Link(0.01, 0.01)
    link.run(2.0)
    link.offset -= 600  # the peer's computer slept
    link.run(2 * AGAIN)
    assert link.ages(0.2) == pytest.approx((0.2, 0.2), abs=0.03)


def test_a_sender_that_is_asked_to_hurry_is_asked_at_once() -> None:
    link = Link()
    link.run(1.5)
    before = link.now
    link.clocks.ask_now("aa", link.now)
    link.run(0.01)
    assert link.clocks.answered("aa") >= before


def test_a_source_that_left_is_forgotten_and_a_flood_is_bounded() -> None:
    link = Link()
    link.run(0.1)
    link.clocks.track((f"forged{number}" for number in range(1000)), link.now)
    before = link.asked
    link.run(0.004)
    assert link.asked - before <= MAX_PEERS
    link.alive = False
    link.clocks.track([], link.now)
    assert link.ages(0.0) is None


def test_a_session_that_commands_is_measured_among_many_that_never_answer() -> None:
    link = Link()
    link.silent = True
    link.clocks.track((f"forged{number}" for number in range(1000)), link.now)
    link.run(0.1)
    link.silent = False
    link.clocks.track_first("bb", link.now)
    link.run(1.1)  # those that do not answer keep their places for a second at most
    assert link.clocks.ages("bb", link.now + OFFSET, link.now) is not None


@pytest.fixture
def wire() -> Iterator[Wire]:
    with Wire() as wire:
        yield wire


def test_the_answer_of_a_foreign_node_does_not_count(wire: Wire) -> None:
    robot, driver, foreign = wire.bus("robot"), wire.bus("driver"), wire.bus("foreign")
    sent, key = driver.stamps("odom")().split(b";")[2], clock_key(driver.id)

    def lie(query: zenoh.Query) -> None:
        with query:
            query.reply(key, str(time.monotonic_ns() + 10**12))

    lies = foreign.session.declare_queryable(key, lie, complete=True)
    querier = robot.session.declare_querier(key)
    wait_for(lambda: querier.matching_status.matching)
    wait_for(lambda: any(reply.replier_id.zid == foreign.session.zid() for reply in querier.get()))
    clocks = robot.peer_clocks(lambda _: True)

    def known() -> tuple[float, float] | None:
        now = time.monotonic()
        clocks.track([driver.id], now)
        clocks.poll(now)
        return clocks.ages(driver.id, int(sent) * 1e-9, now)

    _, oldest = wait_for(known) or (0.0, 0.0)
    assert oldest < 100
    lies.undeclare()


def test_over_zenoh_a_publisher_stamps_and_its_session_answers(wire: Wire) -> None:
    robot, driver = wire.bus("robot"), wire.bus("driver")
    commands, graph = robot.subscribe("cmd_vel", Twist), robot.graph()
    publisher = driver.publisher("cmd_vel", Twist)
    wait_for(lambda: publisher.matched)
    publisher.put(Twist())
    received = wait_for(commands.try_recv)
    assert received is not None
    stamp = received.stamp
    assert isinstance(stamp, Stamp)
    assert (stamp.session, stamp.number, received.source) == (driver.id, 0, driver.source)
    clocks = robot.peer_clocks(graph.has)
    wait_for(lambda: graph.endpoints() and graph.has(driver.id))

    def known() -> tuple[float, float, float] | None:
        now = time.monotonic()
        clocks.track([driver.id], now)
        clocks.poll(now)
        ages = clocks.ages(driver.id, stamp.sent, now)
        return ages and (ages[0], now - stamp.sent, ages[1])

    youngest, age, oldest = wait_for(known) or (0.0, 0.0, 0.0)
    assert 0 <= youngest <= age <= oldest + 0.01 < 100
    assert driver.clock_asked.is_set()
