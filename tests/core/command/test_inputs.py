"""Commands are checked, limited, counted, and reported at most once a second."""

import itertools
import math
from itertools import product
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.command.arbiter import Arbiter
from holozen.command.inputs import MAX_LINES, REPORT_EVERY, CommandStats, ReportLimit, TwistInput
from holozen.command.motion import Motion
from holozen.command.wait_set import Moment
from holozen.limits import STOP
from holozen.messages import CommandSource, Header, Time, Twist, TwistStamped, Vector3
from holozen.transport.pubsub import Received
from holozen.wire import MAX_STAMP_AGE
from tests.core.command.fakes import FakeSenders, received, stamp

CLOCKS = (1000.0, 5.0)  # the day's and the sim's


class Judge:
    """The TwistInput of one robot, and its reports."""

    def __init__(self) -> None:
        self.reports: list[str] = []
        self.twist_input = TwistInput(
            "Fred/cmd_vel",
            Arbiter(0.5),
            FakeSenders(),
            linear=2.0,
            angular=3.0,
            report=self.reports.append,
        )

    def take(
        self,
        message: Twist | TwistStamped | None,
        now: float = 10.0,
        error: str = "",
        priority: str = "DATA",
        source: str = "me@1",
        key: str = "Fred/cmd_vel",
        waited: float = 0.0,
    ) -> None:
        self.twist_input.take(
            [received(message, source, priority, key, error)], Moment(now, now - waited, CLOCKS)
        )

    def motion(self, now: float = 10.0) -> Motion:
        return self.twist_input.arbiter.motion(now).value


@pytest.fixture
def judge() -> Judge:
    return Judge()


def stamped(seconds: float, x: float = 1.0) -> TwistStamped:
    return TwistStamped(Header(Time.of(seconds)), Twist.planar(x))


def test_a_good_command_drives_and_is_counted(judge: Judge) -> None:
    judge.take(Twist.planar(1, -0.5, 2), priority="INTERACTIVE_HIGH", source="teleop@9")
    assert judge.motion() == (1, -0.5, 2)
    status = judge.twist_input.status(10.0)
    assert (status.obeyed, status.priority, status.accepted) == ("teleop@9", "INTERACTIVE_HIGH", 1)
    assert (status.refused, status.last_refusal, judge.reports) == ({}, "", [])


def test_the_status_of_a_silent_robot_names_no_driver(judge: Judge) -> None:
    judge.take(Twist.planar(1))
    status = judge.twist_input.status(10.6)
    assert (status.obeyed, status.priority, status.held) == ("", "", True)
    assert judge.twist_input.arbiter.resume(10.6) == ""
    status = judge.twist_input.status(10.6)
    assert (status.held, status.resumed) == (False, 1)


def test_what_a_planar_base_cannot_do_is_left_out(judge: Judge) -> None:
    judge.take(Twist(Vector3(1, 0, 5), Vector3(5, 5, 1)))
    assert judge.motion() == (1, 0, 1)


def test_a_faster_command_is_clamped_in_its_direction_and_reported(judge: Judge) -> None:
    judge.take(Twist.planar(30, 40, -50))
    assert judge.motion() == pytest.approx((1.2, 1.6, -3))
    status = judge.twist_input.status(10.0)
    assert (status.accepted, status.clamped, status.refused, status.last_refusal) == (1, 1, {}, "")
    assert status.last_clamped.startswith("me@1: over the limits of 2 m/s and 3 rad/s")
    assert judge.reports == [
        "Fred/cmd_vel: from me@1: over the limits of 2 m/s and 3 rad/s, clamped: (30, 40, -50)"
    ]


def test_a_report_on_any_of_its_keys_names_the_robot_by_its_cmd_vel() -> None:
    reports: list[str] = []
    both = TwistInput(
        "bot/cmd_vel", Arbiter(0.5), FakeSenders(), 1, 1, reports.append, others=("bot/twist",)
    )
    both.take(
        [received(Twist.planar(2), "me@1", "DATA", "bot/twist", "")], Moment(10.0, 10.0, CLOCKS)
    )
    assert both.arbiter.motion(10.0).value == (1, 0, 0)
    assert reports == [
        "bot/cmd_vel: from me@1: over the limits of 1 m/s and 1 rad/s, clamped: (2, 0.0, 0.0)"
    ]


def test_a_number_that_is_not_finite_never_drives() -> None:
    for part, axis, bad in product(("linear", "angular"), "xyz", (math.nan, math.inf, -math.inf)):
        twist = Twist()
        setattr(getattr(twist, part), axis, bad)
        for message, path in (
            (twist, f"{part}.{axis}"),
            (TwistStamped(twist=twist), f"twist.{part}.{axis}"),
        ):
            judge = Judge()
            judge.take(message)
            assert judge.motion() == STOP
            assert judge.twist_input.status(10.0).refused == {"not finite": 1}
            assert judge.reports == [f"Fred/cmd_vel: from me@1: {path} is not a finite number"]


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        ("not a Twist: Input data was truncated", "malformed"),
        ("oversized: 70000 bytes", "oversized"),
    ],
)
def test_what_is_no_message_is_counted_by_its_kind(judge: Judge, error: str, kind: str) -> None:
    judge.take(None, error=error)
    status = judge.twist_input.status(10.0)
    assert status.refused == {kind: 1}
    assert status.last_refusal == f"me@1: {error}"
    assert status.accepted == 0


def test_a_stamp_may_be_off_by_half_a_second_by_the_clock_it_is_nearest_to() -> None:
    for seconds in (1000.0, 999.6, 1000.4, 5.0, 5.4):
        judge = Judge()
        judge.take(stamped(seconds))
        assert (judge.motion(), judge.reports) == ((1, 0, 0), []), seconds
    for seconds, age in (
        (999.4, "0.6 s old"),
        (1000.6, "0.6 s in the future"),
        (7.0, "2.0 s in the future"),
    ):
        judge = Judge()
        judge.take(stamped(seconds))
        assert judge.motion() == STOP
        assert judge.reports == [
            f"Fred/cmd_vel: from me@1: stale: its header.stamp is {age}, and the limit is "
            f"{MAX_STAMP_AGE} s; set the clocks by NTP, or leave the stamp at 0"
        ]
        assert judge.twist_input.status(10.0).refused == {"stale": 1}


def test_a_stamp_makes_a_command_older_but_never_younger(judge: Judge) -> None:
    judge.take(stamped(999.7))
    assert judge.motion(10.1) == (1, 0, 0)
    assert judge.motion(10.3) == STOP  # half a second after its stamp
    judge.take(stamped(1000.3), now=20.0)
    assert judge.motion(20.4) == (1, 0, 0)
    assert judge.motion(20.6) == STOP


def test_a_command_that_may_have_waited_too_long_is_refused_but_a_stop_is_not(judge: Judge) -> None:
    judge.take(Twist.planar(1), waited=0.4)
    assert judge.motion() == (1, 0, 0)
    judge.take(Twist.planar(2), waited=0.6)
    assert judge.motion() == (1, 0, 0)
    assert judge.reports == [
        "Fred/cmd_vel: from me@1: old: it may have waited 0.6 s for this busy process, and the "
        "limit is 0.5 s; send it again"
    ]
    judge.take(Twist(), waited=math.inf)
    assert judge.motion() == STOP
    assert judge.twist_input.status(10.0).refused == {"old": 1}


@pytest.mark.parametrize("key", ["*/cmd_vel", "**", "Ann/cmd_vel"])
def test_a_command_for_every_robot_is_for_none(judge: Judge, key: str) -> None:
    judge.take(Twist.planar(1), key=key)
    assert judge.motion() == STOP
    assert judge.twist_input.status(10.0).refused == {"wildcard": 1}
    assert judge.reports == [f"Fred/cmd_vel: from me@1: a command for {key!r}; name one robot"]


def test_no_stamp_is_a_fresh_one(judge: Judge) -> None:
    judge.take(stamped(0.0))
    assert judge.motion() == (1, 0, 0)


def test_an_overruled_and_a_held_source_are_counted_apart(judge: Judge) -> None:
    judge.take(Twist.planar(1), now=1.0, priority="INTERACTIVE_HIGH", source="teleop@9")
    judge.take(Twist.planar(2), now=1.1)
    judge.take(Twist.planar(2), now=9.0)
    assert judge.twist_input.status(9.0).refused == {"overruled": 1, "held": 1}
    assert judge.motion(9.0) == STOP


def test_a_source_without_a_name_is_called_by_its_priority(judge: Judge) -> None:
    judge.take(Twist.planar(1), source="")
    assert judge.twist_input.status(10.0).obeyed == "anonymous (DATA)"


def test_the_status_names_the_sources_their_rates_and_the_driver(judge: Judge) -> None:
    for count in range(21):
        judge.take(
            Twist.planar(0.1),
            now=1.0 + count * 0.05,
            priority="INTERACTIVE_HIGH",
            source="teleop@9",
        )
        if count % 2 == 0:
            judge.take(
                Twist.planar(0.2),
                now=1.0 + count * 0.05,
                priority="DATA_LOW",
                source="controller@8",
            )
        judge.twist_input.status(1.0 + count * 0.05)
    teleop, controller = judge.twist_input.status(2.0).sources
    assert (teleop.rate, controller.rate) == pytest.approx((20, 10), abs=1)
    assert teleop == CommandSource(
        "teleop@9", "INTERACTIVE_HIGH", teleop.rate, obeyed=True, held=False
    )
    assert controller == CommandSource(
        "controller@8", "DATA_LOW", controller.rate, obeyed=False, held=True
    )
    assert judge.twist_input.status(9.0).sources == []


def test_while_it_is_stopped_every_command_is_refused_and_counted(judge: Judge) -> None:
    judge.twist_input.arbiter.stop("ann@1", 10.0)
    judge.take(Twist.planar(1), priority="INTERACTIVE_HIGH")
    judge.take(Twist())
    judge.take(stamped(1000.0))
    status = judge.twist_input.status(10.0)
    assert (status.stopped, status.obeyed, status.held) == ("ann@1", "", True)
    assert status.refused == {"stopped": 3}
    assert judge.reports == [
        "Fred/cmd_vel: from me@1: stopped: by ann@1; `holozen release` lets it drive again"
    ]
    assert judge.motion() == STOP


@pytest.mark.parametrize("seconds", [900.0, 1100.0])
def test_a_stop_is_obeyed_whatever_its_stamp(judge: Judge, seconds: float) -> None:
    judge.take(Twist.planar(1), priority="INTERACTIVE_HIGH")
    judge.take(stamped(seconds, 0.0), priority="INTERACTIVE_HIGH", source="ann@1")
    assert judge.motion() == STOP
    judge.take(Twist.planar(1), now=10.1, priority="INTERACTIVE_HIGH")
    assert judge.motion(10.1) == STOP, "a stopped source waits"


@pytest.mark.parametrize("kind", ["late", "stale"])
def test_a_source_on_a_bad_link_that_commands_has_not_let_go(judge: Judge, kind: str) -> None:
    """What comes too late to be obeyed still shows that its sender has not let go."""
    judge.twist_input.arbiter.stop("ann@1", 10.0)
    judge.twist_input.arbiter.release(10.0)
    for now in (10.4, 10.8):
        judge.take(Twist.planar(1) if kind == "late" else stamped(990.0), now, waited=0.6)
    judge.take(Twist.planar(1), now=11.2)
    assert judge.motion(11.2) == STOP
    judge.take(Twist.planar(1), now=11.8)
    assert judge.motion(11.8) == (1, 0, 0)


class Held:
    """A source that commands 20 times a second, and what it sent comes in later, and in part."""

    def __init__(self, stamped: bool) -> None:
        self._senders, self.arbiter, self._stamped = FakeSenders(), Arbiter(0.5), stamped
        self._input = TwistInput(
            "Fred/cmd_vel", self.arbiter, self._senders, linear=2.0, angular=3.0
        )
        self._numbers = itertools.count()

    def take(
        self,
        begin: float,
        end: float,
        at: float = 0.0,
        since: float = 0.0,
        last: int = 99,
        zero: float | None = None,
    ) -> None:
        """What it sent from `begin` to `end` (s) comes in: each at once, or its `last` samples
        together `at` a time, before which nothing was read `since` another. At `zero` it sends a
        stop in between.
        """
        times = [tick / 20 for tick in range(round(begin * 20), round(end * 20))]
        heard = begin if at else math.inf  # over a link that is held up it hears no beat either
        stamps = [stamp(next(self._numbers), min(sent, heard)) for sent in times]
        come: list[Received[Twist | TwistStamped]] = [
            received(Twist.planar(0.0 if sent == zero else 1.0), text if self._stamped else "me@aa")
            for sent, text in zip(times, stamps, strict=True)
        ]
        for sent, each in zip(
            [at] if at else times, [come[-last:]] if at else [[one] for one in come], strict=True
        ):
            self._input.take(each, Moment(sent, since or sent, CLOCKS))


@pytest.mark.parametrize(
    ("stamped", "held_up"),
    [
        (True, {}),
        (True, {"last": 3}),
        (True, {"since": 12.0, "last": 3}),
        (False, {"since": 12.0}),
    ],
    ids=["link", "link that loses samples", "receiver", "receiver, without stamps"],
)
@pytest.mark.parametrize(
    ("stopped", "released"), [(10.0, 11.5), (12.2, 13.0)], ids=["before", "meanwhile"]
)
def test_a_link_or_a_receiver_that_is_held_up_is_no_silence(
    stamped: bool, held_up: dict[str, Any], stopped: float, released: float
) -> None:
    held = Held(stamped)
    held.take(9.0, min(stopped, 12.0))
    held.arbiter.stop("ann@1", stopped)
    held.take(min(stopped, 12.0), min(released, 12.0))
    held.arbiter.release(released)
    held.take(min(released, 12.0), 12.0)
    held.take(12.0, 13.6, at=13.6, **held_up)
    held.take(13.6, 15.0)
    assert held.arbiter.motion(15.0).value == STOP
    held.take(15.6, 17.0)
    assert held.arbiter.motion(17.0).value == (1, 0, 0), "it was silent"


def test_a_source_that_began_during_the_stop_on_a_link_that_was_held_up_has_not_let_go() -> None:
    held = Held(stamped=True)
    held.arbiter.stop("ann@1", 12.0)
    held.arbiter.release(13.0)
    held.take(12.8, 13.6, at=13.6)
    held.take(13.6, 15.0)
    assert held.arbiter.motion(15.0).value == STOP


def test_a_source_that_commanded_the_impossible_during_a_stop_has_not_let_go(judge: Judge) -> None:
    judge.twist_input.arbiter.stop("ann@1", 10.0)
    judge.take(Twist.planar(200.0), now=10.4)
    judge.twist_input.arbiter.release(10.5)
    judge.take(Twist.planar(1.0), now=10.6)
    assert judge.motion(10.6) == STOP


def test_a_release_moves_no_source_that_went_on_after_a_stop_of_its_own_on_a_link_that_was_held_up() -> (  # noqa: E501
    None
):
    held = Held(stamped=True)
    held.take(9.0, 10.0)
    held.arbiter.stop("ann@1", 10.0)
    held.take(10.0, 10.5, zero=10.45)
    held.arbiter.release(11.0)
    held.take(10.5, 12.0, at=12.0)
    assert held.arbiter.motion(12.0).value == STOP
    held.take(12.0, 14.0)
    assert held.arbiter.motion(14.0).value == STOP, "it never let go after that"
    held.take(14.0, 14.5, zero=14.0)
    assert held.arbiter.motion(14.5).value == (1, 0, 0)


def test_refusals_are_reported_once_a_second_with_the_number_of_the_others(judge: Judge) -> None:
    for now in (1.0, 1.2, 1.4, 1.0 + REPORT_EVERY, 2.1):
        judge.take(None, now, error="not a Twist")
    assert judge.reports == [
        "Fred/cmd_vel: from me@1: not a Twist",
        "Fred/cmd_vel: from me@1: not a Twist (and 2 more)",
    ]
    judge.take(None, now=3.5, error="not a Twist")
    assert judge.reports[2] == "Fred/cmd_vel: from me@1: not a Twist (and 1 more)"
    assert judge.twist_input.status(3.5).refused == {"malformed": 6}


def test_a_command_whose_link_was_held_up_is_refused_and_counted(judge: Judge) -> None:
    """0.3 s, by the robot's own time."""
    judge.take(Twist.planar(1), now=10.0, source=stamp(0, 9.7))
    assert judge.motion(10.0) == STOP
    assert judge.twist_input.status(10.0).refused == {"late": 1}
    judge.take(Twist.planar(1), now=10.0, source=stamp(0, 9.99, "bb"))
    assert judge.motion(10.0) == (1, 0, 0)


def test_a_fleet_reports_some_lines_a_second_and_counts_the_others() -> None:
    limit, reports = ReportLimit(), list[str]()
    robots = [CommandStats(reports.append, limit) for _ in range(300)]
    for robot in robots:
        robot.refuse("Fred/cmd_vel", "old", "old: it was late", "pilot@1", 10.0)
    assert len(reports) == MAX_LINES
    robots[-1].refuse("Fred/cmd_vel", "old", "old: it was late", "pilot@1", 10.0 + REPORT_EVERY)
    assert reports[MAX_LINES:] == ["Fred/cmd_vel: from pilot@1: old: it was late (and 1 more)"]
    assert robots[-1].refused == {"old": 2}


def test_a_long_reason_is_cut(judge: Judge) -> None:
    judge.take(None, error="x" * 5000)
    assert len(judge.twist_input.status(10.0).last_refusal) == 300


numbers = st.floats() | st.sampled_from([1e308, -1e308])
twists = st.builds(
    Twist,
    st.builds(Vector3, numbers, numbers, numbers),
    st.builds(Vector3, numbers, numbers, numbers),
)
commands: st.SearchStrategy[Twist | TwistStamped] = twists | st.builds(
    TwistStamped,
    st.builds(Header, st.builds(Time, st.integers(-(2**63), 2**63), st.integers(0, 999_999_999))),
    twists,
)


@given(st.lists(commands, max_size=5))
def test_whatever_comes_the_engine_gets_finite_velocities_within_the_limits(
    given: list[Twist | TwistStamped],
) -> None:
    judge = Judge()
    for message in given:
        judge.take(message)
    motion = judge.motion()
    assert isinstance(motion, tuple)
    x, y, turn = motion
    assert math.hypot(x, y) <= 2 * (1 + 1e-9)
    assert abs(turn) <= 3
    status = judge.twist_input.status(10.0)
    assert status.accepted + sum(status.refused.values()) == len(given)


def test_by_default_refusals_are_reported_on_standard_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    judge = Judge()
    judge.twist_input = TwistInput("cmd_vel", Arbiter(0.5), FakeSenders(), 1, 1)
    judge.take(Twist(), key="*")
    assert capsys.readouterr().err == "cmd_vel: from me@1: a command for '*'; name one robot\n"


@pytest.mark.parametrize(
    ("twist", "reason"),
    [
        (Twist(Vector3(1.5e308, 1.5e308)), "linear.x is 1.5e+308 m/s; at most 100"),
        (Twist(Vector3(0, -101)), "linear.y is -101 m/s; at most 100"),
        (Twist(Vector3(0, 0, 1e308)), "linear.z is 1e+308 m/s; at most 100"),
        (Twist(Vector3(), Vector3(1e308)), "angular.x is 1e+308 rad/s; at most 1000"),
        (Twist(Vector3(), Vector3(0, 0, 1001)), "angular.z is 1001 rad/s; at most 1000"),
    ],
)
def test_an_implausible_value_is_refused_by_name_and_does_not_stop_the_robot_either(
    judge: Judge, twist: Twist, reason: str
) -> None:
    judge.take(Twist.planar(1), source="me@1", priority="INTERACTIVE_HIGH")
    judge.take(twist, source="forged@2", priority="INTERACTIVE_HIGH")
    status = judge.twist_input.status(10.0)
    assert (status.obeyed, status.refused, status.last_refusal) == (
        "me@1",
        {"implausible": 1},
        f"forged@2: {reason}",
    )
    assert judge.motion() == (1, 0, 0)
