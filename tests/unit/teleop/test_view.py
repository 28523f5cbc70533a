"""What the screen says: what is commanded and measured, and a warning for each thing that is amiss."""

from dataclasses import replace

import pytest

from services.teleop.view import Fragments, State, render

GOOD = State(
    robot="Fred",
    speed=0.5,
    turn=1.0,
    command=(0.5, 0.0, -1.0),
    measured=(0.45, -0.0001, -0.9),
    odom_age=0.012,
    stale=False,
    listeners=["sim", "recorder"],
    obeyed="teleop@1",
    source="teleop@1",
)


def text(state: State) -> str:
    return "".join(words for _, words in render(state))


def styled(fragments: Fragments, style: str) -> str:
    return "".join(words for name, words in fragments if name == style)


def warnings(state: State) -> str:
    return styled(render(state), "class:warning")


def test_a_robot_that_drives_is_shown_without_a_warning() -> None:
    shown = text(GOOD)
    assert " holozen teleop Fred\n" in shown
    assert " speed 0.500 m/s   turn 1.000 rad/s" in shown
    assert " command   x +0.500  y +0.000 m/s  turn -1.000 rad/s" in shown
    assert " measured  x +0.450  y +0.000 m/s  turn -0.900 rad/s" in shown  # no -0.000
    assert " odom      12 ms old" in shown
    assert " listening sim, recorder" in shown
    assert " driver    you" in shown
    assert warnings(GOOD) == ""


def test_a_command_that_moves_the_robot_stands_out() -> None:
    assert "x +0.500" in styled(render(GOOD), "class:driving")
    assert styled(render(replace(GOOD, command=(0.0, 0.0, 0.0))), "class:driving") == ""
    assert styled(render(replace(GOOD, command=None)), "class:driving") == ""


def test_a_silent_teleop_says_so_and_a_stop_is_shown_as_zeros() -> None:
    assert " command   silent" in text(replace(GOOD, command=None))
    assert " command   x +0.000  y +0.000 m/s  turn +0.000" in text(replace(GOOD, command=(0.0, 0.0, 0.0)))


def test_without_a_name_it_is_the_robot_at_the_root() -> None:
    assert "the robot at the root" in text(replace(GOOD, robot=""))


def test_no_odom_is_a_warning_and_the_speed_is_unknown() -> None:
    state = replace(GOOD, odom_age=float("inf"), stale=True)
    assert "NO ODOM: nothing was heard from a robot" in warnings(state)
    assert " measured  unknown" in text(state)


def test_stale_odom_is_a_warning_with_its_age_and_the_speed_is_unknown() -> None:
    state = replace(GOOD, odom_age=3.25, stale=True)
    assert "ODOM IS STALE: the last one came 3.2 s ago" in warnings(state)
    assert " measured  unknown" in text(state)
    assert "+0.450" not in text(state)


def test_nobody_listening_is_a_warning() -> None:
    assert "NOBODY IS LISTENING on cmd_vel" in warnings(replace(GOOD, listeners=[]))


def test_the_driver_is_named() -> None:
    assert " driver    controller@2" in text(replace(GOOD, obeyed="controller@2"))
    assert " driver    nobody\n" in text(replace(GOOD, obeyed=""))
    assert " driver    nobody; r lets the controller drive again\n" in text(replace(GOOD, obeyed="", held=True))


def test_nobody_drives_before_anything_was_heard() -> None:
    assert "driver    you" not in text(State("", 0.5, 1.0, source="teleop@1"))


def test_a_note_is_shown() -> None:
    assert " not handed over: teleop@2 drives\n" in warnings(replace(GOOD, note="not handed over: teleop@2 drives"))


@pytest.mark.parametrize(
    "state",
    [
        GOOD,
        State("x" * 64, 999.9, 999.9, note="note"),
        replace(GOOD, command=(-999.9, -999.9, -999.9), measured=(-999.9, -999.9, -999.9), held=True, obeyed=""),
        replace(GOOD, stale=True, odom_age=99999.9, listeners=[], note="not handed over"),
    ],
)
def test_it_fits_a_terminal_of_80_by_24(state: State) -> None:
    rows = text(state).rstrip("\n").split("\n")
    assert len(rows) <= 24
    assert max(map(len, rows)) <= 80
