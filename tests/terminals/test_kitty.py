"""Real keys in the terminal kitty drive the robot: held, together, let go, and out of sight."""

import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.testing import Wire, wait_for
from holozen.testing.wire import command
from tests.integration.robots import Robot, place, planar

from .broken import broken_teleop
from .kitty import Display, Kitty, Program
from .motion import OFTEN, assert_nothing_moves, drives, stands

pytestmark = pytest.mark.needs("Xvfb", "kitty", "setxkbmap", "xdotool")

V, W = 0.4, 0.8  # m/s, rad/s
DIAGONAL = V / 2**0.5
SPEEDS = ("--speed", str(V), "--turn", str(W))
# Keys by their place: the codes of X for what a US keyboard calls so.
KEY_I, KEY_J, COMMA, SHIFT, CTRL, KEY_C = "31", "44", "59", "50", "37", "54"

Start = Callable[..., Program]


@pytest.fixture
def start(kitty: Kitty, town: Wire, robot: Robot) -> Start:
    """`start("--mode", "latch")`: a teleop in kitty, ready for keys."""

    def start(*flags: str, words: list[str] | None = None) -> Program:
        program = kitty.run(words or command("teleop", *SPEEDS, *flags, *town.flags))
        wait_for(lambda: "\x1b[>15u" in program.raw, what="the releases to be asked for")
        program.wait_for_text("listening sim")
        return program

    return start


@pytest.fixture
def keys(display: Display, kitty: Kitty) -> Display:
    """The keyboard: no key is down, and kitty has the focus."""
    display.run("setxkbmap", "us")
    display.keys(
        "keyup", "shift", "keyup", "ctrl", *[word for key in (KEY_I, KEY_J, COMMA, KEY_C) for word in ("keyup", key)]
    )
    display.focus(kitty.window)
    return display


def test_the_robot_moves_while_a_key_is_held_and_stops_when_it_is_let_go(
    start: Start, keys: Display, robot: Robot
) -> None:
    with start():
        seen = len(robot.commands.messages())
        keys.keys("keydown", "i")
        drives(robot, x=V)
        begin = robot.newest()
        end = robot.pass_time(1.5)
        assert place(end)[0] - place(begin)[0] == pytest.approx(1.5 * V, abs=0.1)
        assert {planar(command) for command in robot.commands.messages()[seen:]} == {(V, 0, 0, 0)}, "no stutter"
        keys.keys("keyup", "i")
        stands(robot)
        assert_nothing_moves(robot)


def test_two_keys_together_are_one_motion_and_the_one_that_stays_goes_on(
    start: Start, keys: Display, robot: Robot
) -> None:
    with start():
        keys.keys("keydown", "i")
        drives(robot, x=V)
        keys.keys("keydown", "l")
        drives(robot, x=V, turn=-W)
        robot.pass_time(1.0)  # long after i has stopped to repeat
        drives(robot, x=V, turn=-W)
        keys.keys("keyup", "i")
        drives(robot, turn=-W)
        keys.keys("keydown", "comma")
        drives(robot, x=-V, turn=-W)
        keys.keys("keyup", "l")
        drives(robot, x=-V)
        keys.keys("keyup", "comma")
        stands(robot)


def test_diagonally_the_speed_is_the_speed(start: Start, keys: Display, robot: Robot) -> None:
    with start():
        keys.keys("keydown", "i", "keydown", "shift", "keydown", "j")
        drives(robot, x=DIAGONAL, y=DIAGONAL)
        keys.keys("keydown", "comma")
        drives(robot, y=V)
        keys.keys("keyup", "i", "keyup", "comma", "keyup", "j", "keyup", "shift")
        stands(robot)


@pytest.mark.parametrize("first", ["j", "shift"])
def test_with_shift_it_strafes_whichever_of_both_keys_is_let_go_first(
    start: Start, keys: Display, robot: Robot, first: str
) -> None:
    with start():
        keys.keys("keydown", "shift", "keydown", "j")
        drives(robot, y=V)
        keys.keys("keyup", first)
        keys.keys("keyup", "j", "keyup", "shift")
        stands(robot)
        assert_nothing_moves(robot)


def test_space_stops_though_another_key_is_held(start: Start, keys: Display, robot: Robot) -> None:
    with start():
        keys.keys("keydown", "i")
        drives(robot, x=V)
        keys.keys("key", "space")
        stands(robot)
        assert_nothing_moves(robot, 1.0)  # i repeats no more; it would have to be pressed again
        keys.keys("keyup", "i", "keydown", "i")
        drives(robot, x=V)
        keys.keys("keyup", "i")
        stands(robot)


def test_a_lost_focus_stops_and_its_return_with_the_key_still_held_moves_nothing(
    start: Start, keys: Display, kitty: Kitty, robot: Robot
) -> None:
    with start():
        keys.keys("keydown", "i")
        drives(robot, x=V)
        keys.focus(keys.root)
        stands(robot)
        keys.focus(kitty.window)
        assert_nothing_moves(robot, 1.5)  # while the key repeats again
        keys.keys("keyup", "i")
        keys.keys("keydown", "i")
        drives(robot, x=V)
        keys.keys("keyup", "i")
        stands(robot)


def test_a_key_that_was_held_before_the_start_moves_nothing(
    start: Start, keys: Display, kitty: Kitty, robot: Robot
) -> None:
    for _ in range(5):
        keys.keys("keydown", "i", "sleep", "0.8")  # it repeats
        with start():
            assert_nothing_moves(robot, 1.0)
            keys.keys("keyup", "i")
            keys.keys("keydown", "i")
            drives(robot, x=V)
            keys.keys("keyup", "i")
            stands(robot)


def test_latched_a_key_sets_the_motion_until_another(start: Start, keys: Display, robot: Robot) -> None:
    with start("--mode", "latch"):
        keys.keys("key", "i")
        drives(robot, x=V)
        robot.pass_time(1.0)
        drives(robot, x=V)
        keys.keys("key", "j")
        drives(robot, turn=W)
        keys.keys("key", "k")
        stands(robot)


def test_a_deadman_needs_space_too(start: Start, keys: Display, robot: Robot) -> None:
    with start("--deadman"):
        keys.keys("keydown", "i")
        assert_nothing_moves(robot)
        keys.keys("keydown", "space")
        drives(robot, x=V)
        keys.keys("keyup", "space")
        stands(robot)
        keys.keys("keydown", "space")
        drives(robot, x=V)
        keys.keys("keyup", "i")
        stands(robot)
        keys.keys("keyup", "space")


@pytest.mark.parametrize("layout", ["de", "fr", "ru", "gr"])
def test_other_keyboards_drive_with_the_same_keys(start: Start, keys: Display, robot: Robot, layout: str) -> None:
    with start():
        keys.run("setxkbmap", layout)
        for key, motion in ((KEY_I, (V, 0, 0)), (KEY_J, (0, 0, W)), (COMMA, (-V, 0, 0))):
            keys.keys("keydown", key)
            drives(robot, *motion)
            keys.keys("keyup", key)
            stands(robot)
        keys.keys("keydown", SHIFT, "keydown", KEY_J)
        drives(robot, y=V)
        keys.keys("keyup", SHIFT, "keyup", KEY_J)
        stands(robot)


def test_a_key_let_go_after_the_keyboard_was_changed_stops(start: Start, keys: Display, robot: Robot) -> None:
    with start():
        keys.keys("keydown", KEY_I)
        drives(robot, x=V)
        keys.run("setxkbmap", "ru")
        keys.keys("keyup", KEY_I)
        stands(robot)
        assert_nothing_moves(robot)


def test_what_is_pasted_by_the_mouse_never_drives(start: Start, keys: Display, kitty: Kitty, robot: Robot) -> None:
    with kitty.run(["printf", r"\033]52;p;aWlpaQpKSg==\007"]) as program:  # iiii, a new line, JJ
        program.ended()
    with start() as program:
        seen = len(robot.commands.messages())
        keys.keys("mousemove", "--window", kitty.window, "100", "100", "click", "2", "key", "w")
        program.wait_for_text("0.44")  # the key after it was read
        robot.newest()
        assert robot.commands.messages()[seen:] == []


@pytest.mark.parametrize("run", range(OFTEN))
def test_a_kitty_that_hangs_stops_the_robot_and_what_it_kept_back_moves_nothing(
    start: Start, keys: Display, kitty: Kitty, robot: Robot, run: int
) -> None:
    with start() as program:
        keys.keys("keydown", "i")
        drives(robot, x=V)
        kitty.signal(signal.SIGSTOP)
        try:
            stands(robot)
            keys.keys("keyup", "i", "keydown", "j", "sleep", "0.8")
            seen = len(robot.commands.messages())
        finally:
            kitty.signal(signal.SIGCONT)
        assert_nothing_moves(robot, 1.0)
        assert not [command for command in robot.commands.messages()[seen:] if any(planar(command))]
        program.wait_for_text("answers again")
        keys.keys("keyup", "j")
        keys.keys("keydown", "j")
        drives(robot, turn=W)
        keys.keys("keyup", "j")
        stands(robot)


def assert_left_tidy(program: Program, code: int) -> None:
    left = program.ended()
    assert left == {"code": code, "modes": True, "flags": "\x1b[?0", "flags of the other screen": "\x1b[?0"}


def test_ctrl_c_quits_and_leaves_the_keyboard_as_it_was(start: Start, keys: Display, robot: Robot) -> None:
    with start() as program:
        keys.keys("keydown", "i")
        drives(robot, x=V)
        keys.keys("keydown", "ctrl", "key", "c", "keyup", "ctrl")
        assert_left_tidy(program, 0)
        stands(robot)
        keys.keys("keyup", "i")


def test_ctrl_c_quits_on_a_russian_keyboard(start: Start, keys: Display) -> None:
    with start() as program:
        keys.run("setxkbmap", "ru")
        keys.keys("keydown", CTRL, "key", KEY_C, "keyup", CTRL)
        assert_left_tidy(program, 0)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT], ids=lambda n: n.name)
def test_a_signal_leaves_the_keyboard_as_it_was(start: Start, number: int) -> None:
    with start() as program:
        program.signal(number)
        assert_left_tidy(program, 0)


def test_a_crash_leaves_the_keyboard_as_it_was(
    start: Start, keys: Display, town: Wire, robot: Robot, tmp_path: Path
) -> None:
    script = broken_teleop(tmp_path, "a key's callback")
    with start(words=[sys.executable, str(script), *SPEEDS, *town.flags]) as program:
        keys.keys("keydown", "i")
        drives(robot, x=V)
        keys.keys("key", "w")
        assert_left_tidy(program, 1)
        stands(robot)
        keys.keys("keyup", "i")


def test_a_window_that_is_closed_stops_the_robot(display: Display, folder: Path, town: Wire, robot: Robot) -> None:
    with Kitty(display, folder) as kitty:
        program = kitty.run(command("teleop", *SPEEDS, *town.flags))
        program.wait_for_text("listening sim")
        display.keys("keydown", "i")
        drives(robot, x=V)
        kitty.close_window()
        stands(robot)
        display.keys("keyup", "i")
