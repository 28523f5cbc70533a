"""When the controller lets go of the robot, and when it drives again."""

import pytest

from holozen.messages import CommandStatus
from services.controller.yield_policy import Cause, Yielded, YieldPolicy

ME, PERSON = "controller@1", "teleop@2"


@pytest.fixture
def policy() -> YieldPolicy:
    return YieldPolicy(ME)


def test_it_may_drive_at_first(policy: YieldPolicy) -> None:
    assert policy.yielded is None
    policy.update(CommandStatus())
    assert policy.yielded is None


def test_it_goes_on_while_it_is_the_one_obeyed(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=ME))
    assert policy.yielded is None


def test_it_yields_to_any_other_driver(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=ME))
    policy.update(CommandStatus(obeyed=PERSON, held=True))
    assert policy.yielded == Yielded(Cause.SOURCE, PERSON)


def test_it_does_not_take_the_robot_back_when_the_other_falls_silent(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=PERSON, held=True))
    policy.update(CommandStatus(held=True))
    assert policy.yielded == Yielded(Cause.SOURCE, PERSON)


def test_it_yields_to_the_last_driver(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=PERSON, held=True))
    policy.update(CommandStatus(obeyed="topic_pub@3", held=True))
    assert policy.yielded == Yielded(Cause.SOURCE, "topic_pub@3")


def test_a_robot_that_others_drove_before_it_came_is_not_taken(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(held=True))
    assert policy.reason.startswith(
        "yields: another source drove this robot; resume with `holozen controller --resume` or "
        "press r"
    )


def test_after_resume_it_drives_again(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=PERSON, held=True))
    policy.update(CommandStatus(resumed=1))
    assert policy.yielded is None


def test_a_resume_that_it_missed_while_it_was_away_counts(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=PERSON, held=True, resumed=1))
    policy.update(CommandStatus(held=False, resumed=3))
    assert policy.yielded is None


def test_an_old_resume_does_not_count(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(resumed=1))
    policy.update(CommandStatus(obeyed=PERSON, held=True, resumed=1))
    policy.update(CommandStatus(resumed=1))
    assert policy.yielded == Yielded(Cause.SOURCE, PERSON)


def test_a_person_driving_right_after_the_resume_is_yielded_to(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=PERSON, held=True))
    policy.update(CommandStatus(obeyed=PERSON, held=True, resumed=1))
    assert policy.yielded == Yielded(Cause.SOURCE, PERSON)


def test_a_restarted_sim_forgets_the_driver_but_the_controller_does_not(
    policy: YieldPolicy,
) -> None:
    policy.update(CommandStatus(resumed=2))
    policy.update(CommandStatus(obeyed=PERSON, held=True, resumed=2))
    policy.update(CommandStatus(resumed=0))
    assert policy.yielded == Yielded(Cause.SOURCE, PERSON)
    policy.update(CommandStatus(resumed=1))
    assert policy.yielded is None


def test_it_yields_to_a_software_stop_and_reports_what_frees_the_robot(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(obeyed=ME))
    assert policy.reason == ""
    policy.update(CommandStatus(held=True, stopped="stop@3"))
    message = (
        "yields: the robot is stopped by stop@3; `holozen release` ends that, then resume "
        "with `holozen"
    )
    assert policy.reason.startswith(message)


def test_after_the_release_it_still_waits_for_the_resume(policy: YieldPolicy) -> None:
    policy.update(CommandStatus(held=True, stopped="stop@3"))
    policy.update(CommandStatus(held=True))
    assert policy.reason.startswith(
        "yields to the stop by stop@3; resume with `holozen controller --resume`"
    )
    policy.update(CommandStatus(resumed=1))
    assert policy.reason == ""


def test_the_advice_on_a_resume_names_the_robot() -> None:
    policy = YieldPolicy(ME, held=True, robot="Fred")
    assert policy.reason.startswith(
        "yields to --held; resume with `holozen controller Fred --resume` or press r"
    )


def test_a_sim_that_was_started_again_forgets_the_stop_but_the_controller_does_not(
    policy: YieldPolicy,
) -> None:
    policy.update(CommandStatus(held=True, stopped="stop@3"))
    policy.update(CommandStatus())
    assert policy.yielded == Yielded(Cause.STOP, "stop@3")
