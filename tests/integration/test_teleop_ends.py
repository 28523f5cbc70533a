"""However a teleop ends, its last command is a stop, and the terminal is as it was."""

import signal
import sys
from pathlib import Path

from holozen.testing import Terminal, Wire, wait_for

from .conftest import deaf, start_sim
from .processes import assert_one_line
from .robots import Robot, moves, planar

ROOT = Path(__file__).parents[2]
DRIVES_ON = ("--mode", "latch")

# A teleop whose next picture fails while it drives.
BROKEN = """
import sys
sys.path.insert(0, {root!r})
from services.teleop import __main__ as teleop, session, telemetry
from services.teleop.input.kitty import Key
def breaks(*_, **__):
    raise RuntimeError("broken on purpose")
take = session.Session.take
def take_and_break(self, event, now):
    done = take(self, event, now)
    if isinstance(event, Key):
        telemetry.Telemetry.state = breaks
    return done
session.Session.take = take_and_break
sys.exit(teleop.main(sys.argv[1:]))
"""


def driving(robot: Robot, terminal: Terminal) -> Terminal:
    """The teleop in this terminal, while it drives."""
    terminal.wait_for_text("listening")
    robot.knows("teleop")
    terminal.hold_until("i", lambda: moves(robot.newest(), 0.5, 0, 0))
    return terminal


def assert_tidy(terminal: Terminal) -> None:
    """The terminal has its modes, its first screen and its cursor again."""
    assert terminal.modes() == terminal.modes_before
    last = {
        code: terminal.raw.rfind(f"\x1b[?{code}")
        for code in ("1049h", "1049l", "25l", "25h", "2004h", "2004l")
    }
    assert last["1049h"] < last["1049l"], "the full screen was left"
    assert last["25l"] < last["25h"], "the cursor is shown"
    assert last["2004h"] < last["2004l"], "paste is plain again"


def test_without_a_terminal_it_reports_that_in_one_line(town: Wire) -> None:
    assert_one_line(town.run("teleop"), 2, "needs a terminal")


def test_a_signal_stops_the_robot_and_leaves_the_terminal_tidy(town: Wire, robot: Robot) -> None:
    with driving(robot, town.terminal("teleop", *DRIVES_ON)) as terminal:
        terminal.process.signal(signal.SIGHUP)
        assert terminal.process.wait() == 0
        robot.stands()
        robot.wait_for_stop_command()
        assert_tidy(terminal)
        assert "Traceback" not in terminal.raw


def test_ctrl_c_stops_the_robot_and_quits(town: Wire, robot: Robot) -> None:
    with driving(robot, town.terminal("teleop", *DRIVES_ON)) as terminal:
        terminal.type("\x03")
        assert terminal.process.wait() == 0
        robot.stands()
        robot.wait_for_stop_command()
        assert_tidy(terminal)


def test_ctrl_c_that_was_typed_during_a_pause_quits(town: Wire, robot: Robot) -> None:
    with driving(robot, town.terminal("teleop", *DRIVES_ON)) as terminal:
        terminal.process.signal(signal.SIGSTOP)
        robot.stands()
        terminal.type("i\x03")
        terminal.process.signal(signal.SIGCONT)
        assert terminal.process.wait() == 0
        assert_tidy(terminal)


def test_signals_to_an_idle_teleop_publish_nothing_nor_does_a_size_that_changes_without_terminal(
    town: Wire, robot: Robot
) -> None:
    with town.terminal("teleop") as terminal:
        terminal.wait_for_text("listening")
        commands = robot.commands.from_now()
        for number in (signal.SIGTSTP, signal.SIGWINCH, signal.SIGCONT, signal.SIGTERM):
            terminal.process.signal(number)
        assert terminal.process.wait() == 0
        robot.newest()
        assert commands.messages() == []
        assert_tidy(terminal)


def test_a_terminal_that_is_closed_stops_the_robot(town: Wire, robot: Robot) -> None:
    with driving(robot, town.terminal("teleop", *DRIVES_ON)) as terminal:
        terminal.hang_up()
        terminal.process.wait()
        robot.stands()
        robot.wait_for_stop_command()


def test_an_exception_stops_the_robot_and_is_one_error_line(
    town: Wire, robot: Robot, tmp_path: Path
) -> None:
    """Of each other part of the teleop: tests/terminals/test_ways_to_die.py."""
    script = tmp_path / "broken_teleop.py"
    script.write_text(BROKEN.format(root=str(ROOT)))
    with Terminal([sys.executable, str(script), *DRIVES_ON, *town.flags]) as terminal:
        terminal.wait_for_text("listening")
        robot.knows("teleop")
        commands = robot.commands.from_now()
        terminal.hold_until("i", lambda: terminal.process.returncode is not None)
        assert terminal.process.wait() == 1
        robot.stands()
        commands.next(lambda command: any(planar(command)))
        robot.wait_for_stop_command()
        assert_tidy(terminal)
        assert (
            "teleop: RuntimeError: broken on purpose; a stop was sent to the robot" in terminal.raw
        )
        assert "Traceback" not in terminal.raw


def test_the_stop_arrives_though_a_subscriber_of_cmd_vel_reads_nothing(
    town: Wire, robot: Robot
) -> None:
    with deaf(town, "cmd_vel"), driving(robot, town.terminal("teleop", *DRIVES_ON)) as terminal:
        assert terminal.process.terminate() == 0
        robot.stands()
        robot.wait_for_stop_command()
        assert_tidy(terminal)
        assert "Traceback" not in terminal.raw


def test_a_teleop_alone_reports_that_and_quits_all_the_same_where_its_sim_is_gone(
    wire: Wire,
) -> None:
    terminal = wire.terminal("teleop", *DRIVES_ON)
    screen = terminal.wait_for_text("NO ODOM")
    assert "NO SUBSCRIBER on cmd_vel" in screen
    terminal.hold_until("i", lambda: "+0.500" in terminal.screen())
    sim = start_sim(wire)
    terminal.wait_for_text("listening sim")
    wait_for(lambda: "NO ODOM" not in terminal.screen())
    robot = Robot(wire.bus())
    driving(robot, terminal)
    sim.kill()
    terminal.wait_for_text("ODOM IS STALE")
    assert terminal.process.terminate() == 0

    def stops() -> int:
        return sum(not any(planar(command)) for command in robot.commands.messages())

    wait_for(
        lambda: stops() > 5, what="stops, which are repeated for a second where there is no odom"
    )
    robot.wait_for_stop_command()
    assert_tidy(terminal)


def test_in_a_dumb_terminal_it_writes_lines_and_moves_no_cursor(town: Wire, robot: Robot) -> None:
    with town.terminal("teleop", env={"TERM": "dumb"}) as terminal:
        wait_for(lambda: "odom" in terminal.raw)
        terminal.type("\x03")
        assert terminal.process.wait() == 0
        assert not any(code in terminal.raw for code in ("\x1b[?1049h", "\x1b[?25l", "\x1b[?2026h"))
        assert terminal.modes() == terminal.modes_before
