"""Terminals of other kinds, and those that lose something: a key that is not certain to be held
does not drive.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import pytest

from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command
from tests.integration.robots import Robot

from .broken import ROOT, SCRIPT
from .motion import (
    OFTEN,
    PATIENCE,
    Since,
    assert_drives_on,
    assert_nothing_moved,
    assert_nothing_moves,
    press_until,
    stands,
)
from .operators import SPEED, Operator
from .played import (
    CONSOLE,
    CTRL,
    DUMB,
    FOCUS_IN,
    FOCUS_OUT,
    KITTY,
    RELEASE,
    REPEAT,
    TMUX,
    XTERM,
    Kind,
    Played,
    event,
)

V, W = 0.4, 0.8  # m/s, rad/s
KEY_I, KEY_J, KEY_L, KEY_W, SPACE = map(ord, "ijlw ")

UNTIL_LOST = 1.0
"""s that a terminal hangs for: on a busy machine the robot may stand for another reason, such as
lost odometry, before its answer is missed.
"""

Start = Callable[..., Played]


def sit_down(town: Wire, kind: Kind, *flags: str, late: float = 0.0) -> Played:
    """A teleop in such a terminal, ready for keys."""
    terminal = Played(
        command("teleop", "--speed", str(V), "--turn", str(W), *flags, *town.flags), kind, late=late
    )
    terminal.wait_for_text("listening: sim" if "--plain" in flags else "listening sim")
    if kind.keyboard:
        wait_for(lambda: terminal.flags == 15, what="the releases to be asked for")
    return terminal


@pytest.fixture
def start(town: Wire, robot: Robot) -> Iterator[Start]:
    """`start(KITTY, "--mode", "latch")`: a separate teleop for a test."""
    terminals: list[Played] = []

    def start(kind: Kind, *flags: str, late: float = 0.0) -> Played:
        terminals.append(sit_down(town, kind, *flags, late=late))
        return terminals[-1]

    yield start
    for terminal in terminals:
        terminal.close()


@pytest.fixture(scope="module")
def shared_terminals() -> Iterator[list[Played]]:
    """The terminal that tests share, and those before it whose teleop has ended."""
    terminals: list[Played] = []
    yield terminals
    for terminal in terminals:
        terminal.close()


@pytest.fixture
def terminal(shared_terminals: list[Played], town: Wire, robot: Robot) -> Played:
    """A terminal that reports releases, with a teleop that the tests share. No key is down."""
    if not shared_terminals or shared_terminals[-1].process.returncode is not None:
        shared_terminals.append(sit_down(town, KITTY))
    shared_terminals[-1].type(FOCUS_OUT + FOCUS_IN)
    return shared_terminals[-1]


def drive(
    terminal: Played,
    robot: Robot,
    key: int = KEY_I,
    x: float = 0.0,
    y: float = 0.0,
    turn: float = 0.0,
) -> None:
    """Press a key until the robot moves so."""
    since = Since(robot.odom)
    press_until(
        lambda: since.drove(x, y, turn),
        lambda: terminal.down(key),
        lambda: terminal.up(key),
        terminal.screen,
    )


def assert_a_new_press_drives(terminal: Played, robot: Robot) -> None:
    drive(terminal, robot, KEY_L, turn=-W)
    terminal.release(KEY_L)
    stands(robot)


def test_in_a_terminal_without_releases_a_key_drives_while_it_repeats(
    start: Start, robot: Robot
) -> None:
    terminal = start(CONSOLE)
    since = Since(robot.odom)
    press_until(
        lambda: since.drove(x=V), lambda: terminal.hold("i", 0.7), lambda: None, terminal.screen
    )
    stands(robot)
    assert terminal.flags_left == {}
    assert "\x1b[>" not in terminal.raw, "an old Linux console would print the rest"


def test_a_repeat_without_a_press_moves_nothing(terminal: Played, robot: Robot) -> None:
    for _ in range(5):
        terminal.repeat(KEY_I)
    assert_nothing_moves(robot)
    terminal.release(KEY_I)
    assert_a_new_press_drives(terminal, robot)


def test_a_lost_focus_stops_until_a_new_press(terminal: Played, robot: Robot) -> None:
    assert "\x1b[?1004h" in terminal.raw, "it asks for reports of focus"
    drive(terminal, robot, x=V)
    terminal.type(FOCUS_OUT)
    stands(robot)
    terminal.type(FOCUS_IN)
    terminal.repeat(KEY_I)
    assert_nothing_moves(robot)
    assert_a_new_press_drives(terminal, robot)


def test_keys_that_moved_nothing_are_let_go_too_when_their_release_is_lost(
    start: Start, robot: Robot
) -> None:
    terminal = start(KITTY, "--deadman")

    def both() -> None:
        terminal.press(SPACE)
        terminal.press(KEY_I)

    def neither() -> None:
        terminal.release(SPACE)
        terminal.release(KEY_I)

    def assert_i_was_let_go() -> None:
        terminal.press(SPACE)
        assert_nothing_moves(robot)
        since = Since(robot.odom)
        press_until(lambda: since.drove(x=V), both, neither, terminal.screen)
        terminal.release(SPACE)
        stands(robot)
        terminal.release(KEY_I)

    terminal.press(KEY_I)
    terminal.type(FOCUS_OUT)
    terminal.type(FOCUS_IN)
    assert_i_was_let_go()

    def hung() -> bool:
        """Whether it noticed that it hung: it does not where a busy machine kept it waiting too."""
        terminal.press(KEY_I)
        terminal.freeze()
        robot.pass_time(UNTIL_LOST)
        terminal.release(KEY_I)
        terminal.thaw()
        with suppress(AssertionError):
            wait_for(lambda: "answers again" in terminal.screen(), PATIENCE)
            return True
        return False

    wait_for(hung)
    assert_i_was_let_go()


def test_after_a_lost_release_the_same_key_stops_when_it_is_let_go_again(
    terminal: Played, robot: Robot
) -> None:
    drive(terminal, robot, x=V)
    terminal.press(KEY_I)
    terminal.release(KEY_I)
    stands(robot)


def test_a_release_that_comes_in_pieces_is_one(terminal: Played, robot: Robot) -> None:
    drive(terminal, robot, x=V)
    for piece in ("\x1b", "[1", "05;1:", "3u"):
        terminal.type(piece)
        time.sleep(0.12)  # longer than an Escape alone is waited for: that is what is shown here
    stands(robot)
    assert_nothing_moves(robot)
    assert_a_new_press_drives(terminal, robot)


def test_answers_that_come_late_but_in_time_change_nothing(start: Start, robot: Robot) -> None:
    terminal = start(KITTY, late=0.15)

    def again() -> None:
        terminal.up(KEY_I)
        drive(terminal, robot, x=V)

    again()
    assert_drives_on(robot, (V, 0, 0, 0), again, os.getpid(), terminal.process.pid)


def test_a_key_that_counts_for_long_is_watched_as_one_that_is_held(
    start: Start, robot: Robot
) -> None:
    terminal = start(XTERM, "--key-timeout", "60")
    drive(terminal, robot, x=V)

    def is_watched() -> bool:
        """Whether it is asked more often than one that does not drive: every half second."""
        asked = len(terminal.asked)
        robot.pass_time(1.0)
        return len(terminal.asked) - asked > 4

    wait_for(is_watched, what="questions so often that an answer is missed in time")


def test_a_terminal_whose_answers_stop_coming_stops_the_robot(start: Start, robot: Robot) -> None:
    terminal = start(KITTY, "--mode", "latch")
    drive(terminal, robot, x=V)
    terminal.late = 3600.0
    stands(robot)


@pytest.mark.parametrize(
    ("kind", "mode"), [(KITTY, "hold"), (XTERM, "latch")], ids=["kitty held", "xterm latched"]
)
def test_a_hanging_terminal_stops_the_robot_and_keys_typed_during_it_move_nothing(
    start: Start, robot: Robot, kind: Kind, mode: str
) -> None:
    terminal = start(kind, "--mode", mode)
    drive(terminal, robot, x=V)
    terminal.freeze()
    stands(robot)
    robot.pass_time(UNTIL_LOST)
    # A terminal that goes on first passes on the keys that it kept, then answers what it was asked.
    terminal.down(KEY_J)
    terminal.thaw()
    assert_nothing_moves(robot, 0.7)
    drive(terminal, robot, KEY_L, turn=-W)


# Which terminal, after how many seconds it answers, and how many later the keys come that it kept.
BREATHS = (
    [
        (kind, late, apart)
        for kind in (KITTY, XTERM, TMUX)
        for late in (0.0, 0.1)
        for apart in (0.0, 0.01)
    ]
    if OFTEN > 1
    else [(KITTY, 0.0, 0.01), (XTERM, 0.1, 0.0)]
)
NAMES = {KITTY: "kitty", XTERM: "xterm", TMUX: "tmux"}


@pytest.mark.parametrize("run", range(OFTEN))
@pytest.mark.parametrize(
    ("kind", "late", "apart"), BREATHS, ids=lambda value: NAMES.get(value, f"{value} s")
)
def test_keys_in_one_breath_with_the_answers_of_a_terminal_that_hung_move_nothing(
    start: Start, robot: Robot, kind: Kind, late: float, apart: float, run: int
) -> None:
    """Neither with the answers to old queries nor with, or right after, the first answer to a new
    one; nor does a key that is held from then on.
    """
    terminal = start(kind, "--plain", "--mode", "latch", late=late)
    terminal.apart = apart
    drive(terminal, robot, x=V)
    terminal.freeze()
    stands(robot)
    robot.pass_time(UNTIL_LOST)
    commands = robot.commands.from_now()
    key = event(KEY_J) if kind.keyboard else "j"
    kept = (event(KEY_I, 0, RELEASE) if kind.keyboard else "") + key, key
    terminal.kept = list(kept)
    thawed = time.monotonic()
    terminal.thaw()
    wait_for(lambda: not terminal.kept, what="two answers with keys")
    sent = terminal.hold(event(KEY_J, 0, REPEAT) if kind.keyboard else key, 0.5, 0.03, 0.03)
    # Where only repeats are reported, a key that is silent for so long was let go: a busy machine
    # typed too late.
    if kind.keyboard or max(b - a for a, b in pairwise([thawed, *sent])) < 0.5:
        assert_nothing_moved(commands)
    if not kind.keyboard:
        robot.pass_time(0.9)  # it was let go
    terminal.up(KEY_J)
    drive(terminal, robot, KEY_J, turn=W)


def test_pasted_text_never_drives(start: Start, robot: Robot) -> None:
    terminal = start(KITTY)
    commands = robot.commands.from_now()

    def speed() -> str:
        """The speed on the screen; "" if there is none."""
        return terminal.screen().partition("speed     ")[2].partition(" ")[0]

    def assert_moves_nothing(pasted: str) -> None:
        before = speed()
        for part in (
            "\x1b[200~",
            pasted[: len(pasted) // 2],
            pasted[len(pasted) // 2 :],
            "\x1b[201~",
        ):
            for begin in range(0, len(part), 4000):
                terminal.type(part[begin : begin + 4000])
        press_until(  # what follows the text was read
            lambda: speed() not in ("", before),
            lambda: terminal.press(KEY_W),
            lambda: terminal.release(KEY_W),
            terminal.screen,
        )
        robot.newest()
        assert commands.messages() == []

    for pasted in (
        "iiii",
        f"{event(KEY_I)}{event(KEY_J)}",
        "k\r\ni\r\n",
        "i" * 100_000,
        "\x1b[200~i",
    ):
        assert_moves_nothing(pasted)


def test_another_terminal_that_does_not_speak_kitty_takes_over(start: Start, robot: Robot) -> None:
    """As with `docker attach`: the teleop goes on in another window, while a key was held in the
    first.
    """
    terminal = start(KITTY)
    drive(terminal, robot, x=V)
    terminal.kind = XTERM
    stands(robot)
    terminal.type("k")  # shows that an operator is there
    drive(terminal, robot, KEY_L, turn=-W)
    stands(robot)


def test_a_window_of_another_size_without_releases_is_known_at_once(
    start: Start, robot: Robot
) -> None:
    terminal = start(KITTY)
    terminal.kind = XTERM
    terminal.resize(90, 30)
    terminal.wait_for_text("by key repeat")
    drive(terminal, robot, KEY_L, turn=-W)
    stands(robot)


def test_after_a_while_without_a_terminal_the_next_one_drives(start: Start, robot: Robot) -> None:
    """As with `docker attach` after a detach: what was asked during it stays unanswered."""
    terminal = start(KITTY)
    drive(terminal, robot, x=V)
    terminal.kind = DUMB
    stands(robot)
    asked = terminal.raw.count("\x1b[c")
    wait_for(lambda: terminal.raw.count("\x1b[c") > asked, what="an unanswered question")
    terminal.pushed = {False: [], True: []}
    terminal.kind = KITTY
    terminal.resize(99, 30)
    wait_for(lambda: terminal.flags == 15, what="the releases to be requested again")
    assert_a_new_press_drives(terminal, robot)


def test_another_terminal_that_speaks_kitty_too_is_asked_for_releases(
    terminal: Played, robot: Robot
) -> None:
    terminal.pushed = {False: [], True: []}  # a window that was opened just now
    wait_for(lambda: terminal.flags == 15, what="the releases to be requested again")
    assert_a_new_press_drives(terminal, robot)


def test_suspended_it_gives_the_keyboard_back_and_takes_it_again(
    town: Wire, sim: Process, robot: Robot
) -> None:
    with Operator(town, robot.bus, "", sim.pid) as operator:
        terminal = operator.sit_down(shell=True)
        drive(terminal, robot, x=SPEED)
        terminal.type(event(ord("z"), CTRL))
        stands(robot)
        wait_for(lambda: terminal.flags_left == {}, what="the keyboard to be given back")
        operator.foreground()
        wait_for(lambda: terminal.flags == 15, what="the keyboard to be taken again")
        terminal.repeat(KEY_I)
        assert_nothing_moves(robot)
        drive(terminal, robot, KEY_L, turn=-1.0)
        terminal.release(KEY_L)
        stands(robot)


def test_after_the_computer_slept_a_key_must_be_pressed_again(
    town: Wire, robot: Robot, tmp_path: Path
) -> None:
    """The monotonic clock stands still during it, and the release of a key may be lost."""
    asleep = (
        "import time; clock = time.monotonic; time.sleep(1); time.monotonic = lambda: clock() - 1"
    )
    script = tmp_path / "sleeps.py"
    script.write_text(SCRIPT.format(root=str(ROOT), statement=asleep))
    with Played(
        [sys.executable, str(script), "--speed", str(V), "--turn", str(W), *town.flags], KITTY
    ) as terminal:
        terminal.wait_for_text("listening sim")
        wait_for(lambda: terminal.flags == 15)
        drive(terminal, robot, x=V)
        terminal.press(KEY_W)
        robot.stands()  # by the silence
        commands = robot.commands.from_now()
        terminal.wait_for_text("paused")
        assert_nothing_moves(robot)
        assert_nothing_moved(commands)


@pytest.mark.parametrize("what", ["the terminal", "the teleop"])
def test_ctrl_c_quits_whatever_hangs_also_on_a_keyboard_of_another_script(
    start: Start, robot: Robot, what: str
) -> None:
    terminal = start(KITTY)
    drive(terminal, robot, x=V)
    terminal.freeze() if what == "the terminal" else terminal.process.signal(signal.SIGSTOP)
    robot.stands()
    terminal.press(ord("с"), CTRL, base=ord("c"))  # noqa: RUF001  # Cyrillic
    terminal.thaw()
    terminal.process.signal(signal.SIGCONT)
    assert terminal.process.wait() == 0
    assert terminal.modes() == terminal.modes_before


def test_it_pops_what_it_pushed_and_nothing_more(start: Start, robot: Robot) -> None:
    terminal = start(KITTY, late=0.3)
    terminal.pushed[False].append(1)  # the shell's own
    terminal.type(event(ord("c"), CTRL))
    assert terminal.process.wait() == 0
    wait_for(lambda: terminal.flags_left == {False: [1]})
    assert terminal.modes() == terminal.modes_before


def test_an_end_before_the_terminal_answered_leaves_it_tidy(town: Wire) -> None:
    with Played(command("teleop", *town.flags), KITTY, late=0.5) as terminal:
        wait_for(lambda: terminal.asked)
        assert terminal.process.terminate() == 0
        wait_for(lambda: terminal.flags_left == {})
        assert terminal.modes() == terminal.modes_before


EARLY = """
import os, sys
sys.path.insert(0, {root!r})
from holozen.cli import main
import services.teleop.{module} as part
before = {name}
number = int(sys.argv.pop(1))
def signals():
    os.kill(os.getpid(), number)
class Dying:
    def __del__(self):
        signals()
def early(*given):
    {name} = before
    before(*given)
    {how}()
{name} = early
sys.argv.insert(1, "teleop")
main()
"""


@pytest.mark.parametrize(
    ("number", "module", "name", "how"),
    [
        (signal.SIGINT, "input.terminal", "part.Terminal.write", "signals"),
        (signal.SIGHUP, "app", "part.TeleopApp.__init__", "signals"),
        (signal.SIGTERM, "app", "part.TeleopApp.__init__", "Dying"),
    ],
    ids=[
        "while the terminal is set up",
        "while the application is made",
        "in a callback of the interpreter",
    ],
)
def test_a_signal_at_the_very_start_leaves_the_terminal_tidy(
    town: Wire, tmp_path: Path, number: signal.Signals, module: str, name: str, how: str
) -> None:
    script = tmp_path / "early.py"
    script.write_text(EARLY.format(root=str(ROOT), module=module, name=name, how=how))
    with Played([sys.executable, str(script), str(int(number)), *town.flags], KITTY) as terminal:
        assert terminal.process.wait() == 0
        assert terminal.modes() == terminal.modes_before
        assert "Traceback" not in terminal.raw
        assert terminal.raw.rfind("[?1049l") > terminal.raw.rfind("[?1049h")
