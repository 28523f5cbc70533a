"""The rules of who drives hold after every sequence of events, and the search finds each rule that
is broken.
"""

import math
import os

import pytest

from holozen.command.arbiter import AUTOPILOT, PERSON, Arbiter, Case, Driver, Source
from holozen.command.motion import is_stop
from holozen.command.outcome import Outcome
from tests.core.command.explorer import SCRIPT, Promise, explore

ANN, BOB = Source("ann", PERSON), Source("bob", PERSON)
SCRIPT_1, SCRIPT_2 = Source("script", SCRIPT), Source("another script", SCRIPT)
CONTROLLER = Source("controller", AUTOPILOT)


SETS = [
    pytest.param((ANN, BOB), True, id="two people, resets and pauses"),
    pytest.param((ANN, SCRIPT_1, CONTROLLER), False, id="all ranks"),
    pytest.param((ANN, SCRIPT_1, SCRIPT_2), False, id="two scripts"),
]
if os.environ.get("HOLOZEN_LONG") == "1":
    SETS += [
        pytest.param((ANN, SCRIPT_1, SCRIPT_2, CONTROLLER), False, id="all ranks and two scripts"),
        pytest.param((ANN, BOB, SCRIPT_1), True, id="two people and a script, resets and pauses"),
        pytest.param((ANN, CONTROLLER), True, id="a controller, resets and pauses"),
    ]


@pytest.mark.timeout(900)  # the long ones take minutes
@pytest.mark.parametrize(("sources", "with_world"), SETS)
def test_the_promises_hold_after_every_sequence_of_events(
    sources: tuple[Source, ...], with_world: bool
) -> None:
    assert explore(sources, with_world) > 2000


class StopIsIgnored(Arbiter):
    """Rule 5: a stopped robot obeys."""

    def judge(self, case: Case) -> Outcome:
        outcome = super().judge(case)
        return (
            Outcome.DRIVES if outcome is Outcome.STOPPED and not is_stop(case.motion) else outcome
        )


class ReleaseFreesAll(Arbiter):
    """Rule 5: commands that were sent before the release move the robot."""

    def release(self, now: float) -> None:
        self.state.stopped_by = None


class StoppedDriverNeedNotLetGo(Arbiter):
    """Rule 3: the key that drove when the stop was set drives after the release."""

    def stop(self, by: str, now: float) -> None:
        self.state.driver = None
        super().stop(by, now)


class EqualsTakeOver(Arbiter):
    """Rule 1: the last of equals drives."""

    def judge(self, case: Case) -> Outcome:
        outcome = super().judge(case)
        equal = case.driver is not None and case.driver.source.rank == case.source.rank
        return Outcome.DRIVES if outcome is Outcome.OVERRULED and equal else outcome


class LowerOnesStop(Arbiter):
    """Rule 2: a stop from below is obeyed."""

    def judge(self, case: Case) -> Outcome:
        outcome = super().judge(case)
        return Outcome.STOPS if outcome is Outcome.OVERRULED and is_stop(case.motion) else outcome


class TheDeadGiveWay(Arbiter):
    """Rule 2: whose driver died is free at once."""

    def forget(self, name: str, of_members: bool = False) -> None:
        if self.state.driver and self.state.driver.source.name == name:
            self._drive(None)


class TheDeadDriveOn(Arbiter):
    """Rule 2: the end of a driver stops nothing."""

    def forget(self, name: str, of_members: bool = False) -> None:
        pass


class NobodyLetsGo(Arbiter):
    """Rule 3: a command counts that was held while another drove."""

    def _must_let_go(self, case: Case) -> bool:
        return False


class ADelayIsASilence(Arbiter):
    """Rule 3: a link that was held up lets go."""

    def judge(self, case: Case) -> Outcome:
        return super().judge(case._replace(sent=case.sent._replace(silence=math.inf)))


class NobodyWaits(Arbiter):
    """Rule 4: the scripts that a person overruled go on without `resume`."""

    def judge(self, case: Case) -> Outcome:
        outcome = super().judge(case)
        return (
            Outcome.DRIVES
            if outcome is Outcome.WAITS_FOR_RESUME and case.source.rank < AUTOPILOT
            else outcome
        )


class NewAutopilotsDrive(Arbiter):
    """Rule 4: an autopilot that was not there when a person drove need not wait."""

    def _yields(self, rank: int) -> bool:
        return False


class ResumeLetsGo(Arbiter):
    """Rule 3: a held key drives after `resume`."""

    def resume(self, now: float) -> str:
        reason = super().resume(now)
        if not reason:
            self.state.records = {}
        return reason


class ResumeAlways(Arbiter):
    """`resume` takes the robot from the person who drives."""

    def resume_refusal(self, now: float) -> str:
        return ""


class ARespawnFrees(Arbiter):
    """A robot that is spawned again knows nothing of the stop."""

    def inherit(self, other: Arbiter, now: float) -> None:
        pass


class AResetMovesOn(Arbiter):
    """What was sent before a reset counts after it."""

    def begin(self, now: float, without_watchdog: bool = True) -> None:
        self._drive(None)


class SilenceMoves(Arbiter):
    """No watchdog: a robot goes on without commands."""

    def _driver_at(self, time: float) -> Driver | None:
        return self.state.driver


MUTANTS = [
    each for each in globals().values() if isinstance(each, type) and issubclass(each, Arbiter)
][1:]


@pytest.mark.parametrize("mutant", MUTANTS)
def test_each_broken_rule_is_found(mutant: type[Arbiter]) -> None:
    with pytest.raises(Promise, match="after: "):
        for other, with_world in ((CONTROLLER, False), (SCRIPT_1, False), (BOB, True)):
            explore((ANN, other), with_world, lambda: mutant(0.5))
