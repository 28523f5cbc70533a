"""Manners: when the controller lets go, and when it takes the robot again."""

import pytest

from holozen.messages import CommandStatus
from services.controller.yielding import Manners

ME, PERSON = "controller@1", "teleop@2"


@pytest.fixture
def manners() -> Manners:
    return Manners(ME)


def test_it_may_drive_at_first(manners: Manners) -> None:
    assert manners.yielded_to == ""
    manners.see(CommandStatus())
    assert manners.yielded_to == ""


def test_it_goes_on_while_it_is_the_one_obeyed(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=ME))
    assert manners.yielded_to == ""


def test_it_yields_to_anybody_else_who_drives(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=ME))
    manners.see(CommandStatus(obeyed=PERSON, held=True))
    assert manners.yielded_to == PERSON


def test_it_does_not_take_the_robot_back_when_the_other_falls_silent(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=PERSON, held=True))
    manners.see(CommandStatus(held=True))
    assert manners.yielded_to == PERSON


def test_it_yields_to_the_last_who_drove(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=PERSON, held=True))
    manners.see(CommandStatus(obeyed="topic_pub@3", held=True))
    assert manners.yielded_to == "topic_pub@3"


def test_a_robot_that_others_drove_before_it_came_is_not_taken(manners: Manners) -> None:
    manners.see(CommandStatus(held=True))
    assert manners.yielded_to == "somebody before"


def test_after_resume_it_drives_again(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=PERSON, held=True))
    manners.see(CommandStatus(resumed=1))
    assert manners.yielded_to == ""


def test_a_resume_that_it_missed_while_it_was_away_counts(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=PERSON, held=True, resumed=1))
    manners.see(CommandStatus(held=False, resumed=3))
    assert manners.yielded_to == ""


def test_an_old_resume_is_none(manners: Manners) -> None:
    manners.see(CommandStatus(resumed=1))
    manners.see(CommandStatus(obeyed=PERSON, held=True, resumed=1))
    manners.see(CommandStatus(resumed=1))
    assert manners.yielded_to == PERSON


def test_a_person_who_drives_right_after_the_resume_is_yielded_to(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=PERSON, held=True))
    manners.see(CommandStatus(obeyed=PERSON, held=True, resumed=1))
    assert manners.yielded_to == PERSON


def test_a_sim_that_was_started_again_forgets_who_drove_but_the_controller_does_not(manners: Manners) -> None:
    manners.see(CommandStatus(resumed=2))
    manners.see(CommandStatus(obeyed=PERSON, held=True, resumed=2))
    manners.see(CommandStatus(resumed=0))
    assert manners.yielded_to == PERSON
    manners.see(CommandStatus(resumed=1))
    assert manners.yielded_to == ""


def test_it_yields_to_a_software_stop_and_says_what_frees_the_robot(manners: Manners) -> None:
    manners.see(CommandStatus(obeyed=ME))
    assert manners.reason == ""
    manners.see(CommandStatus(held=True, stopped="stop@3"))
    told = "yields: the robot is stopped by stop@3; `holozen release` frees it, and then `holozen controller --resume`"
    assert manners.reason.startswith(told)


def test_after_the_release_it_still_waits_for_the_resume(manners: Manners) -> None:
    manners.see(CommandStatus(held=True, stopped="stop@3"))
    manners.see(CommandStatus(held=True))
    assert manners.reason.startswith("yields to the stop by stop@3; `holozen controller --resume`")
    manners.see(CommandStatus(resumed=1))
    assert manners.reason == ""


def test_a_sim_that_was_started_again_forgets_the_stop_but_the_controller_does_not(manners: Manners) -> None:
    manners.see(CommandStatus(held=True, stopped="stop@3"))
    manners.see(CommandStatus())
    assert manners.yielded_to == "the stop by stop@3"
