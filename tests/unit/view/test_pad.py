"""A pad moves a robot while a button is held, and by nothing else."""

from services.view.pad import HELD, OTHER, SETTLING, SILENT, Pad

STOP = (0.0, 0.0, 0.0)
FORWARD = (1.0, 0.0, 0.0)


def test_a_held_button_commands_and_its_release_stops_until_the_robot_rests() -> None:
    pad = Pad()
    assert pad.command(0.0, False) is None
    assert pad.hold(1, "forward", 0.0) == ""
    assert pad.command(0.01, False) == FORWARD
    pad.release(1, "forward", 0.1)
    assert pad.command(0.11, False) == STOP
    assert pad.command(0.3, True) is None
    assert pad.command(0.31, False) is None


def test_a_stop_is_repeated_for_a_second_at_most() -> None:
    pad = Pad()
    pad.hold(1, "forward", 0.0)
    pad.release(1, "forward", 0.1)
    assert pad.command(0.1 + SETTLING - 0.01, False) == STOP
    assert pad.command(0.1 + SETTLING + 0.01, False) is None


def test_two_buttons_combine_and_a_diagonal_is_no_faster() -> None:
    pad = Pad()
    for button in ("forward", "left", "turn left"):
        pad.hold(1, button, 0.0)
    x, y, turn = pad.command(0.0, False) or STOP
    assert abs(x * x + y * y - 1) < 1e-9 and turn == 1.0


def test_silence_is_a_stop_and_what_is_reported_afterwards_counts_only_for_a_new_button() -> None:
    pad = Pad()
    pad.hold(1, "forward", 0.0)
    late = HELD + 0.01
    assert pad.command(late, False) == STOP
    assert pad.expired(1, late) == {"forward": SILENT}
    pad.hold(1, "forward", late)
    assert pad.command(late, True) is None
    pad.renew(1, "forward")
    pad.hold(1, "forward", late + 1)
    assert pad.command(late + 1, False) == FORWARD


def test_a_report_after_silence_does_not_go_on_with_what_was_held_before() -> None:
    pad = Pad()
    pad.hold(1, "forward", 0.0)
    pad.hold(1, "forward", HELD + 0.01)
    assert pad.command(HELD + 0.01, False) == STOP


def test_one_page_drives_until_it_lets_go_or_is_gone() -> None:
    pad = Pad()
    pad.hold(1, "forward", 0.0)
    assert pad.hold(2, "left", 0.01) == OTHER
    pad.close(2, 0.02)
    assert pad.command(0.02, False) == FORWARD
    pad.close(1, 0.03)
    assert pad.command(0.04, False) == STOP
    assert pad.hold(2, "left", 0.05) == ""
    assert pad.command(0.05, False) == (0.0, 1.0, 0.0)


def test_a_button_that_was_refused_does_not_drive_once_the_other_page_lets_go() -> None:
    pad = Pad()
    pad.hold(1, "forward", 0.0)
    pad.hold(2, "left", 0.01)
    pad.release(1, "forward", 0.02)
    pad.hold(2, "left", 0.03)
    assert pad.command(0.04, False) == STOP and pad.expired(2, 0.04) == {"left": OTHER}
    pad.renew(2, "left")
    pad.hold(2, "left", 0.05)
    assert pad.command(0.06, False) == (0.0, 1.0, 0.0)


def test_a_release_by_another_page_changes_nothing() -> None:
    pad = Pad()
    pad.hold(1, "forward", 0.0)
    pad.release(2, "forward", 0.01)
    assert pad.command(0.02, False) == FORWARD


def test_a_stop_needs_no_reason_when_a_person_asks_for_it() -> None:
    pad = Pad()
    pad.hold(1, "forward", 0.0)
    pad.command(HELD + 0.01, False)
    pad.renew(1, "forward")
    pad.hold(1, "forward", 1.0)
    pad.stop(1.1)
    assert pad.expired(1, 1.1) == {"forward": ""}
