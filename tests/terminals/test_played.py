"""Terminals of other kinds, and those that lose something: what is not sure to be held does not drive."""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen.testing import Wire, wait_for
from holozen.testing.wire import command
from tests.integration.robots import Robot, planar

from .broken import ROOT, SCRIPT
from .motion import OFTEN, assert_nothing_moves, drives, stands
from .operators import SPEED, Operator
from .played import (
    CTRL,
    DUMB,
    FOCUS_IN,
    FOCUS_OUT,
    KITTY,
    NUM,
    RELEASE,
    REPEAT,
    SHIFT,
    TMUX,
    WITHOUT_RELEASES,
    XTERM,
    Kind,
    Played,
    event,
)  # fmt: skip

V, W = 0.4, 0.8  # m/s, rad/s
KEY_I, KEY_J, KEY_L, COMMA, SPACE = map(ord, "ijl, ")
LOST = 0.5  # s and a step, until a robot stands whose operator cannot be reached

Start = Callable[..., Played]


@pytest.fixture
def start(town: Wire, robot: Robot) -> Iterator[Start]:
    """`start(KITTY, "--mode", "latch")`: a teleop in such a terminal, ready for keys."""
    terminals: list[Played] = []

    def start(kind: Kind, *flags: str, late: float = 0.0) -> Played:
        words = command("teleop", "--speed", str(V), "--turn", str(W), *flags, *town.flags)
        terminal = Played(words, kind, late=late)
        terminals.append(terminal)
        terminal.wait_for_text("listening: sim" if "--plain" in flags else "listening sim")
        if kind.keyboard:
            wait_for(lambda: terminal.flags == 15, what="the releases to be asked for")
        return terminal

    yield start
    for terminal in terminals:
        terminal.close()


def assert_a_new_press_drives(terminal: Played, robot: Robot) -> None:
    terminal.press(KEY_L)
    drives(robot, turn=-W)
    terminal.release(KEY_L)
    stands(robot)


@pytest.mark.parametrize("kind", WITHOUT_RELEASES.values(), ids=WITHOUT_RELEASES)
def test_where_nobody_tells_releases_a_key_drives_while_it_repeats(start: Start, robot: Robot, kind: Kind) -> None:
    terminal = start(kind)
    terminal.hold("i", 1.0)
    drives(robot, x=V)
    stands(robot)
    assert terminal.flags_left == {}
    assert "\x1b[>" not in terminal.raw, "an old Linux console would print the rest"


@pytest.mark.parametrize(
    ("press", "motion"),
    [
        ({"code": 1096, "base": KEY_I}, (V, 0, 0)),  # Russian
        ({"code": 1086, "shifted": 1054, "base": KEY_J, "modifiers": SHIFT}, (0, V, 0)),
        ({"code": 1073, "base": COMMA}, (-V, 0, 0)),
        ({"code": 953, "base": KEY_I}, (V, 0, 0)),  # Greek
        ({"code": ord(";"), "base": COMMA}, (-V, 0, 0)),  # French
        ({"code": ord(";"), "shifted": ord("."), "base": COMMA, "modifiers": SHIFT}, (-V, 0, W)),
        ({"code": COMMA, "shifted": ord(";"), "modifiers": SHIFT}, (-V, 0, 0)),  # German
        ({"code": KEY_I, "modifiers": NUM}, (V, 0, 0)),
    ],
    ids=["ru i", "ru J", "ru ,", "gr i", "fr ;", "fr .", "de <", "num lock"],
)
def test_keys_of_other_keyboards_mean_what_they_say_or_what_stands_in_their_place(
    start: Start, robot: Robot, press: dict[str, int], motion: tuple[float, float, float]
) -> None:
    terminal = start(KITTY)
    terminal.press(**press)
    drives(robot, *motion)
    terminal.release(**press)
    stands(robot)


def test_a_repeat_without_a_press_moves_nothing(start: Start, robot: Robot) -> None:
    terminal = start(KITTY)
    for _ in range(5):
        terminal.repeat(KEY_I)
    assert_nothing_moves(robot)
    terminal.release(KEY_I)
    assert_a_new_press_drives(terminal, robot)


@pytest.mark.parametrize("also", ["", event(KEY_I, 0, 3)], ids=["alone", "with the release after it, as kitty does"])
def test_a_lost_focus_stops_until_a_new_press(start: Start, robot: Robot, also: str) -> None:
    terminal = start(KITTY)
    terminal.press(KEY_I)
    drives(robot, x=V)
    terminal.type(FOCUS_OUT + also)
    stands(robot)
    terminal.type(FOCUS_IN)
    terminal.repeat(KEY_I)
    assert_nothing_moves(robot)
    assert_a_new_press_drives(terminal, robot)


@pytest.mark.parametrize("way", ["focus", "hangs"])
def test_keys_that_moved_nothing_are_let_go_too_when_their_release_is_lost(
    start: Start, robot: Robot, way: str
) -> None:
    terminal = start(KITTY, "--deadman")
    terminal.press(KEY_I)
    if way == "focus":
        terminal.type(FOCUS_OUT)
        terminal.type(FOCUS_IN)
    else:
        terminal.freeze()
        robot.pass_time(1.2)
        terminal.release(KEY_I)
        terminal.thaw()
        robot.pass_time(0.2)
    terminal.press(SPACE)
    assert_nothing_moves(robot)
    terminal.press(KEY_I)
    drives(robot, x=V)
    terminal.release(SPACE)
    stands(robot)


def test_after_a_lost_release_the_same_key_stops_when_it_is_let_go_again(start: Start, robot: Robot) -> None:
    terminal = start(KITTY)
    terminal.press(KEY_I)
    drives(robot, x=V)
    terminal.press(KEY_I)
    terminal.release(KEY_I)
    stands(robot)


def test_a_key_let_go_on_another_layout_is_let_go(start: Start, robot: Robot) -> None:
    terminal = start(KITTY)
    terminal.press(KEY_I)
    drives(robot, x=V)
    terminal.release(1096, base=KEY_I)
    stands(robot)


def test_a_release_that_comes_in_pieces_is_one(start: Start, robot: Robot) -> None:
    terminal = start(KITTY)
    terminal.press(KEY_I)
    drives(robot, x=V)
    for piece in ("\x1b", "[1", "05;1:", "3u"):
        terminal.type(piece)
        time.sleep(0.12)  # longer than an Escape alone is waited for: that is what is shown here
    stands(robot)
    assert_nothing_moves(robot)
    assert_a_new_press_drives(terminal, robot)


@pytest.mark.parametrize("kind", [KITTY, XTERM], ids=["kitty", "xterm"])
def test_answers_that_come_late_but_in_time_change_nothing(start: Start, robot: Robot, kind: Kind) -> None:
    terminal = start(kind, "--mode", "latch", late=0.25)
    seen = len(robot.commands.messages())
    terminal.press(KEY_I) if kind.keyboard else terminal.type("i")
    drives(robot, x=V)
    robot.pass_time(2.0)
    assert {planar(command) for command in robot.commands.messages()[seen:]} == {(V, 0, 0, 0)}


def test_a_key_that_counts_for_long_is_watched_as_one_that_is_held(start: Start, robot: Robot) -> None:
    terminal = start(XTERM, "--key-timeout", "60")
    terminal.type("i")
    drives(robot, x=V)
    asked = len(terminal.asked)
    robot.pass_time(2.0)
    assert len(terminal.asked) - asked > 8, "an answer that is missed is missed in time"


@pytest.mark.parametrize("mode", ["hold", "latch"])
def test_a_terminal_whose_answers_stop_coming_stops_the_robot(start: Start, robot: Robot, mode: str) -> None:
    terminal = start(KITTY, "--mode", mode)
    terminal.press(KEY_I)
    drives(robot, x=V)
    terminal.late = 3600.0
    stands(robot)


@pytest.mark.parametrize(
    ("kind", "mode"), [(KITTY, "hold"), (KITTY, "latch"), (XTERM, "hold"), (XTERM, "latch")],
    ids=["kitty held", "kitty latched", "xterm held", "xterm latched"],
)  # fmt: skip
def test_a_terminal_that_hangs_stops_the_robot_and_what_was_typed_meanwhile_moves_nothing(
    start: Start, robot: Robot, kind: Kind, mode: str
) -> None:
    terminal = start(kind, "--mode", mode)
    terminal.press(KEY_I) if kind.keyboard else terminal.type("i")
    drives(robot, x=V)
    terminal.freeze()
    stands(robot)
    robot.pass_time(0.5)
    seen = len(robot.commands.messages())
    # A terminal that goes on first passes on the keys that it kept, then answers what it was asked.
    terminal.press(KEY_J) if kind.keyboard else terminal.type("jjjj")
    terminal.thaw()
    assert_nothing_moves(robot, 1.0)
    assert not [command for command in robot.commands.messages()[seen:] if any(planar(command))]
    terminal.press(KEY_L) if kind.keyboard else terminal.type("l")
    drives(robot, turn=-W)


@pytest.mark.parametrize("run", range(OFTEN))
@pytest.mark.parametrize("late", [0.0, 0.1], ids=["here", "over ssh"])
@pytest.mark.parametrize("kind", [KITTY, XTERM, TMUX], ids=["kitty", "xterm", "tmux"])
def test_keys_in_one_breath_with_the_answers_of_a_terminal_that_hung_move_nothing(
    start: Start, robot: Robot, kind: Kind, late: float, run: int
) -> None:
    """Both with those to old questions and with the first to a new one; nor does a key that is held since then."""
    terminal = start(kind, "--plain", "--mode", "latch", late=late)
    tells = kind.keyboard
    terminal.press(KEY_I) if tells else terminal.type("i")
    drives(robot, x=V)
    terminal.freeze()
    stands(robot)
    seen = len(robot.commands.messages())
    key = event(KEY_J) if tells else "j"
    terminal.kept = [(event(KEY_I, 0, RELEASE) if tells else "") + key, key]
    terminal.thaw()
    wait_for(lambda: not terminal.kept, what="two answers with keys")
    terminal.hold(event(KEY_J, 0, REPEAT) if tells else key, 1.0, 0.03, 0.03)
    assert not [command for command in robot.commands.messages()[seen:] if any(planar(command))]
    if tells:
        terminal.release(KEY_J)
    else:
        robot.pass_time(0.9)  # it was let go
    terminal.type(key)
    drives(robot, turn=W)


@pytest.mark.parametrize("pasted", ["iiii", f"{event(KEY_I)}{event(KEY_J)}", "k\r\ni\r\n", "i" * 100_000, "\x1b[200~i"])
@pytest.mark.parametrize("kind", [KITTY, XTERM], ids=["kitty", "xterm"])
def test_pasted_text_never_drives(start: Start, robot: Robot, kind: Kind, pasted: str) -> None:
    terminal = start(kind)
    seen = len(robot.commands.messages())
    for part in ("\x1b[200~", pasted[: len(pasted) // 2], pasted[len(pasted) // 2 :], "\x1b[201~"):
        for begin in range(0, len(part), 4000):
            terminal.type(part[begin : begin + 4000])
    terminal.press(ord("w")) if kind.keyboard else terminal.type("w")
    terminal.wait_for_text("0.44")  # it was read
    robot.newest()
    assert robot.commands.messages()[seen:] == []


def test_another_terminal_that_does_not_speak_kitty_takes_over(start: Start, robot: Robot) -> None:
    """As with `docker attach`: the teleop goes on in another window, while a key was held in the first."""
    terminal = start(KITTY)
    terminal.press(KEY_I)
    drives(robot, x=V)
    terminal.kind = XTERM
    stands(robot)

    terminal.type("l")  # shows that somebody is there
    terminal.wait_for_text("answers again")
    terminal.type("k")
    terminal.type("l")
    drives(robot, turn=-W)
    stands(robot)


def test_a_window_of_another_size_that_tells_no_releases_is_known_at_once(start: Start, robot: Robot) -> None:
    terminal = start(KITTY)
    terminal.kind = XTERM
    terminal.resize(90, 30)
    terminal.wait_for_text("by key repeat")
    terminal.hold("l", 0.6)
    drives(robot, turn=-W)
    stands(robot)


def test_after_a_while_without_a_terminal_the_next_one_drives(start: Start, robot: Robot) -> None:
    """As with `docker attach` after a detach: what was asked meanwhile, nobody answers."""
    terminal = start(KITTY)
    terminal.press(KEY_I)
    drives(robot, x=V)
    terminal.kind = DUMB
    stands(robot)
    robot.pass_time(3.0)
    terminal.pushed = {False: [], True: []}
    terminal.kind = KITTY
    terminal.resize(99, 30)
    wait_for(lambda: terminal.flags == 15, what="the releases to be asked for anew")
    terminal.wait_for_text("answers again")  # keys count from then on
    assert_a_new_press_drives(terminal, robot)


def test_another_terminal_that_speaks_kitty_too_is_asked_for_releases(start: Start, robot: Robot) -> None:
    terminal = start(KITTY)
    terminal.pushed = {False: [], True: []}  # a window that was opened just now
    wait_for(lambda: terminal.flags == 15, what="the releases to be asked for anew")
    assert_a_new_press_drives(terminal, robot)


def test_suspended_it_gives_the_keyboard_back_and_takes_it_again(town: Wire, robot: Robot) -> None:
    with Operator(town, robot.bus, "") as operator:
        terminal = operator.sit_down(shell=True)
        terminal.press(KEY_I)
        drives(robot, x=SPEED)
        terminal.type(event(ord("z"), CTRL))
        stands(robot)
        wait_for(lambda: terminal.flags_left == {}, what="the keyboard to be given back")
        operator.foreground()
        wait_for(lambda: terminal.flags == 15, what="the keyboard to be taken again")
        terminal.repeat(KEY_I)
        assert_nothing_moves(robot)
        terminal.press(KEY_L)
        drives(robot, turn=-1.0)
        terminal.release(KEY_L)
        stands(robot)


def test_after_a_sleep_of_the_computer_a_key_is_to_be_pressed_anew(town: Wire, robot: Robot, tmp_path: Path) -> None:
    """The monotonic clock stands still meanwhile, and the release of a key may be lost."""
    asleep = "import time; clock = time.monotonic; time.sleep(1); time.monotonic = lambda: clock() - 1"
    script = tmp_path / "sleeps.py"
    script.write_text(SCRIPT.format(root=str(ROOT), statement=asleep))
    with Played([sys.executable, str(script), "--speed", str(V), "--turn", str(W), *town.flags], KITTY) as terminal:
        terminal.wait_for_text("listening sim")
        wait_for(lambda: terminal.flags == 15)
        terminal.press(KEY_I)
        drives(robot, x=V)
        terminal.press(ord("w"))
        robot.stands()  # by the silence
        assert_nothing_moves(robot, 1.5)


@pytest.mark.parametrize("late", [0.0, 0.3])
def test_it_pops_what_it_pushed_and_nothing_more(start: Start, robot: Robot, late: float) -> None:
    terminal = start(KITTY, late=late)
    terminal.pushed[False].append(1)  # the shell's own
    terminal.type(event(ord("c"), CTRL))
    assert terminal.process.wait() == 0
    wait_for(lambda: terminal.flags_left == {False: [1]})
    assert terminal.modes() == terminal.modes_before


def test_an_end_before_the_terminal_answered_leaves_it_tidy(town: Wire) -> None:
    with Played(command("teleop", *town.flags), KITTY, late=0.5) as terminal:
        wait_for(lambda: terminal.asked)
        terminal.process.signal(signal.SIGTERM)
        assert terminal.process.wait() == 0
        wait_for(lambda: terminal.flags_left == {})
        assert terminal.modes() == terminal.modes_before


EARLY = """
import os, sys
sys.path.insert(0, {root!r})
from services.teleop import __main__ as teleop
import services.teleop.{module} as part
before = {name}
def early(*given):
    {name} = before
    before(*given)
    os.kill(os.getpid(), int(sys.argv[1]))
{name} = early
sys.exit(teleop.main(sys.argv[2:]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize(
    ("module", "name"),
    [("input.terminal", "part.Terminal.write"), ("app", "part.TeleopApp.__init__")],
    ids=["enter", "fly"],
)
def test_a_signal_at_the_very_start_leaves_the_terminal_tidy(
    town: Wire, tmp_path: Path, number: signal.Signals, module: str, name: str
) -> None:
    script = tmp_path / "early.py"
    script.write_text(EARLY.format(root=str(ROOT), module=module, name=name))
    with Played([sys.executable, str(script), str(int(number)), *town.flags], KITTY) as terminal:
        assert terminal.process.wait() == 0
        assert terminal.modes() == terminal.modes_before
        assert "Traceback" not in terminal.raw
        assert terminal.raw.rfind("[?1049l") > terminal.raw.rfind("[?1049h")
