"""Real keys in the terminal kitty drive the robot: held, together, let go, and out of sight."""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen.testing import Wire, wait_for
from holozen.testing.wire import command
from tests.integration.robots import Robot

from .broken import broken_teleop
from .kitty import Display, Kitty, Program
from .motion import (
    OFTEN,
    Since,
    assert_drives_on,
    assert_nothing_moved,
    assert_nothing_moves,
    drives,
    press_until,
    stands,
)

pytestmark = pytest.mark.needs("Xvfb", "kitty", "setxkbmap", "xdotool")

V, W = 0.4, 0.8  # m/s, rad/s
DIAGONAL = V / 2**0.5
SPEEDS = ("--speed", str(V), "--turn", str(W))
# Keys by their place: the codes of X for what a US keyboard calls so.
KEY_I, KEY_J, COMMA, SHIFT, CTRL, KEY_C = "31", "44", "59", "50", "37", "54"
REPEATS = 0.8  # s after which a key that is held repeats

Start = Callable[..., Program]
Drive = Callable[..., None]


@pytest.fixture(scope="module")
def programs() -> Iterator[dict[tuple[str, ...], Program]]:
    """The teleops that run in kitty, by their flags: tests with the same flags share one."""
    programs: dict[tuple[str, ...], Program] = {}
    yield programs
    for program in programs.values():
        program.end()


@pytest.fixture
def start(
    kitty: Kitty, town: Wire, robot: Robot, keys: Display, programs: dict[tuple[str, ...], Program]
) -> Start:
    """`start("--mode", "latch")`: a teleop in kitty, ready for keys."""

    def start(*flags: str, words: list[str] | None = None) -> Program:
        words = words or command("teleop", *SPEEDS, *flags, *town.flags)
        program = programs.get(tuple(words))
        if program is None or not program.runs:
            for other in programs.values():
                other.end()
            programs.clear()
            programs[tuple(words)] = program = kitty.run(words)
            wait_for(lambda: "\x1b[>15u" in program.raw, 20, "the releases to be asked for")
            program.wait_for_text("listening sim")
        return program

    return start


@pytest.fixture
def keys(display: Display, kitty: Kitty) -> Display:
    """The keyboard: no key is down, and kitty has the focus."""
    display.run("setxkbmap", "us")
    display.keys(
        "keyup",
        "shift",
        "keyup",
        "ctrl",
        "keyup",
        "space",
        *[word for key in (KEY_I, KEY_J, COMMA, KEY_C) for word in ("keyup", key)],
    )
    display.focus(kitty.window)
    return display


@pytest.fixture
def drive(keys: Display, robot: Robot) -> Drive:
    """`drive(program, "i", x=V)`: press keys until the robot moves so."""

    def drive(
        program: Program, *names: str, x: float = 0.0, y: float = 0.0, turn: float = 0.0
    ) -> None:
        since = Since(robot.odom)
        press_until(
            lambda: since.drove(x, y, turn),
            lambda: keys.keys(*[word for name in names for word in ("keydown", name)]),
            lambda: keys.keys(*[word for name in reversed(names) for word in ("keyup", name)]),
            program.screen,
        )

    return drive


def test_the_robot_moves_while_a_key_is_held_and_stops_when_it_is_let_go(
    start: Start, keys: Display, kitty: Kitty, robot: Robot, drive: Drive
) -> None:
    program = start()

    def again() -> None:
        keys.keys("keyup", "i")
        drive(program, "i", x=V)

    again()
    assert_drives_on(robot, (V, 0, 0, 0), again, os.getpid(), program.pid, kitty.pid, keys.pid)
    drives(robot, x=V)
    keys.keys("keyup", "i")
    stands(robot)
    assert_nothing_moves(robot)


def test_two_keys_together_are_one_motion_and_the_one_that_stays_goes_on(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    drive(start(), "i", "l", x=V, turn=-W)
    robot.pass_time(REPEATS)  # i has stopped to repeat
    drives(robot, x=V, turn=-W)
    keys.keys("keyup", "i")
    drives(robot, turn=-W)
    keys.keys("keydown", "comma")
    drives(robot, x=-V, turn=-W)
    keys.keys("keyup", "l")
    drives(robot, x=-V)
    keys.keys("keyup", "comma")
    stands(robot)


def test_diagonally_the_speed_is_the_speed(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    drive(start(), "i", "shift", "j", x=DIAGONAL, y=DIAGONAL)
    keys.keys("keydown", "comma")
    drives(robot, y=V)
    keys.keys("keyup", "i", "keyup", "comma", "keyup", "j", "keyup", "shift")
    stands(robot)


def test_with_shift_it_strafes_whichever_of_both_keys_is_let_go_first(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    for first in ("j", "shift"):
        drive(start(), "shift", "j", y=V)
        keys.keys("keyup", first)
        keys.keys("keyup", "j", "keyup", "shift")
        stands(robot)
        assert_nothing_moves(robot)


def test_space_stops_though_another_key_is_held(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    program = start()
    drive(program, "i", x=V)
    keys.keys("key", "space")
    stands(robot)
    assert_nothing_moves(robot, REPEATS)  # i repeats no more; it would have to be pressed again
    keys.keys("keyup", "i")
    drive(program, "i", x=V)
    keys.keys("keyup", "i")
    stands(robot)


def test_a_lost_focus_stops_and_its_return_with_the_key_still_held_moves_nothing(
    start: Start, keys: Display, kitty: Kitty, robot: Robot, drive: Drive
) -> None:
    program = start()
    drive(program, "i", x=V)
    keys.focus(keys.root)
    stands(robot)
    keys.focus(kitty.window)
    assert_nothing_moves(robot, REPEATS)  # the key repeats again
    keys.keys("keyup", "i")
    drive(program, "i", x=V)
    keys.keys("keyup", "i")
    stands(robot)


def test_a_key_that_was_held_before_the_start_moves_nothing(
    start: Start,
    keys: Display,
    robot: Robot,
    programs: dict[tuple[str, ...], Program],
    drive: Drive,
    trials: Callable[[int, int], int],
) -> None:
    for _ in range(trials(1, 5)):
        for program in programs.values():
            program.end()
        commands = robot.commands.from_now()
        keys.keys("keydown", "i", "sleep", f"{REPEATS}")
        program = start()
        assert_nothing_moves(robot)
        assert_nothing_moved(commands)
        keys.keys("keyup", "i")
        drive(program, "i", x=V)
        keys.keys("keyup", "i")
        stands(robot)


def test_latched_a_key_sets_the_motion_until_another(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    program = start("--mode", "latch")
    drive(program, "i", x=V)
    keys.keys("keyup", "i")
    robot.pass_time(0.3)
    drives(robot, x=V)
    keys.keys("key", "j")
    drives(robot, turn=W)
    keys.keys("key", "k")
    stands(robot)


def test_a_deadman_needs_space_too(start: Start, keys: Display, robot: Robot, drive: Drive) -> None:
    program = start("--deadman")
    keys.keys("keydown", "i")
    assert_nothing_moves(robot)
    keys.keys("keyup", "i")
    drive(program, "i", "space", x=V)
    keys.keys("keyup", "space")
    stands(robot)
    keys.keys("keyup", "i")
    drive(program, "i", "space", x=V)
    keys.keys("keyup", "i")
    stands(robot)
    keys.keys("keyup", "space")


def test_other_keyboards_drive_with_the_same_keys(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    program = start()
    for layout in ("de", "fr", "ru", "gr"):
        # kitty is busy with it, perhaps for longer than an answer is waited for
        keys.run("setxkbmap", layout)
        for names, motion in (
            ((KEY_I,), (V, 0, 0)),
            ((COMMA,), (-V, 0, 0)),
            ((SHIFT, KEY_J), (0, V, 0)),
        ):
            x, y, turn = motion
            drive(program, *names, x=x, y=y, turn=turn)
            for name in names:
                keys.keys("keyup", name)
            stands(robot)


def test_a_key_let_go_after_the_keyboard_was_changed_stops(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    drive(start(), KEY_I, x=V)
    keys.run("setxkbmap", "ru")
    keys.keys("keyup", KEY_I)
    stands(robot)
    assert_nothing_moves(robot)


def test_what_is_pasted_by_the_mouse_never_drives(
    start: Start,
    keys: Display,
    kitty: Kitty,
    robot: Robot,
    programs: dict[tuple[str, ...], Program],
) -> None:
    for program in programs.values():
        program.end()
    kitty.run(["printf", r"\033]52;p;aWlpaQpKSg==\007"]).ended()  # iiii, a new line, JJ
    program = start()
    commands = robot.commands.from_now()
    keys.keys("mousemove", "--window", kitty.window, "100", "100", "click", "2")
    press_until(  # the key after it was read
        lambda: "0.440 m/s" in program.screen(),
        lambda: keys.keys("key", "w"),
        lambda: None,
        program.screen,
    )
    robot.newest()
    assert commands.messages() == []
    program.end()  # with its speed


@pytest.mark.parametrize("run", range(OFTEN))
def test_a_kitty_that_hangs_stops_the_robot_and_what_it_kept_back_moves_nothing(
    start: Start, keys: Display, kitty: Kitty, robot: Robot, drive: Drive, run: int
) -> None:
    program = start()
    drive(program, "i", x=V)
    kitty.signal(signal.SIGSTOP)
    try:
        stands(robot)
        keys.keys("keyup", "i", "keydown", "j", "sleep", f"{REPEATS}")
        commands = robot.commands.from_now()
    finally:
        kitty.signal(signal.SIGCONT)
    program.wait_for_text("answers again")
    assert_nothing_moves(robot)
    assert_nothing_moved(commands)
    keys.keys("keyup", "j")
    drive(program, "j", turn=W)
    keys.keys("keyup", "j")
    stands(robot)


def assert_left_tidy(program: Program, code: int) -> None:
    assert program.ended() == {
        "code": code,
        "modes": True,
        "flags": "0",
        "flags of the other screen": "0",
    }


def test_ctrl_c_quits_and_leaves_the_keyboard_as_it_was(
    start: Start, keys: Display, robot: Robot, drive: Drive
) -> None:
    program = start()
    drive(program, "i", x=V)
    keys.keys("keydown", "ctrl", "key", "c", "keyup", "ctrl")
    assert_left_tidy(program, 0)
    stands(robot)
    keys.keys("keyup", "i")


def test_ctrl_c_quits_on_a_russian_keyboard(start: Start, keys: Display) -> None:
    program = start()
    keys.run("setxkbmap", "ru")
    keys.keys("keydown", CTRL, "key", KEY_C, "keyup", CTRL)
    assert_left_tidy(program, 0)


def test_a_signal_leaves_the_keyboard_as_it_was(start: Start) -> None:
    program = start()
    program.signal(signal.SIGQUIT)
    assert_left_tidy(program, 0)


def test_a_crash_leaves_the_keyboard_as_it_was(
    start: Start, keys: Display, town: Wire, robot: Robot, drive: Drive, tmp_path: Path
) -> None:
    script = broken_teleop(tmp_path, "a key's callback")
    program = start(words=[sys.executable, str(script), *SPEEDS, *town.flags])
    drive(program, "i", x=V)
    keys.keys("key", "w")
    assert_left_tidy(program, 1)
    stands(robot)
    keys.keys("keyup", "i")


def test_a_window_that_is_closed_stops_the_robot(
    display: Display, folder: Path, town: Wire, robot: Robot
) -> None:
    with Kitty(display, folder) as kitty:
        program = kitty.run(command("teleop", *SPEEDS, *town.flags))
        program.wait_for_text("listening sim")
        since = Since(robot.odom)
        press_until(
            lambda: since.drove(x=V),
            lambda: display.keys("keydown", "i"),
            lambda: display.keys("keyup", "i"),
            program.screen,
        )
        kitty.close_window()
        stands(robot)
        display.keys("keyup", "i")
