"""`holozen up`: everything in one command, and nothing left of it afterwards."""

import contextlib
import os
import signal
import subprocess
import urllib.error
import urllib.request
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from holozen import data
from holozen.testing import Process, Terminal, Wire, wait_for
from holozen.testing.wire import command
from holozen.transport.errors import ServiceError

from .conftest import Verb, start_sim
from .processes import assert_one_line, parts_at, state_of, wait_for_none, words_of
from .robots import Robot, moves, rests

BOT = str(data.find("urdf", "hb_bot.urdf.xacro"))
STILL = """<robot name="still"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="1 1 1"/></geometry></collision></link></robot>"""
PARTS = {"sim", "pose-service", "controller"}
AT_MOST = 10.0  # s; it promises 2, and a busy machine gets more


def all_run(wire: Wire, parts: set[str]) -> dict[str, int]:
    return wait_for(lambda: found if parts <= set(found := parts_at(wire)) else {}, 20)


def assert_ended(parts: dict[str, int], wire: Wire) -> None:
    """These parts are gone; a helper that a sim has forked ends a moment after it."""
    assert not any(map(words_of, parts.values()))
    wait_for_none(wire)


def driven(robot: Robot) -> None:
    robot.odom.next(lambda odom: not rests(odom))


def test_without_a_terminal_the_controller_drives_the_square_and_the_page_of_a_view_ends_with_it(
    wire: Wire,
) -> None:
    up = wire.start("up", "--rtf", "4", "--size", "0.5", "--laps", "1", "--view", "0")
    up.wait_for_line("up: no terminal here, so no teleop; the rest runs until Ctrl-C or SIGTERM")
    up.wait_for_line("lap 1 goal 3: (0.00, 0.00, 0 deg)", within=40)
    parts = parts_at(wire)
    assert set(parts) >= {"up", "sim", "pose-service"}
    address = up.wait_for_line("http://127.0.0.1:").split()[-1]
    with urllib.request.urlopen(address) as page:
        assert b"holozen" in page.read()
    assert up.terminate(AT_MOST) == 0
    assert_ended(parts, wire)
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(address)
    assert "Traceback" not in up.err


READ_ONLY = 'mount -o remount,bind,ro / && exec "$@"'


@pytest.mark.needs("unshare")
def test_a_root_that_is_read_only_has_room_for_it(wire: Wire) -> None:
    inside = ("unshare", "-rm", "sh", "-c", READ_ONLY, "sh")
    if subprocess.run([*inside, "true"], capture_output=True).returncode:
        pytest.skip("needs a mount namespace of its own")
    up = Process((*inside, *command("up", *wire.flags)))
    with up:
        up.wait_for_line("sim: hb_bot listens on cmd_vel")
        assert up.terminate(AT_MOST) == 0
        assert "Traceback" not in up.err


def test_two_signals_in_a_row_leave_nothing_either(wire: Wire) -> None:
    up = wire.start("up")
    all_run(wire, PARTS)
    up.signal(signal.SIGINT)
    up.interrupt()
    wait_for_none(wire)
    assert "Traceback" not in up.err


def test_a_signal_right_at_the_start_leaves_nothing(wire: Wire) -> None:
    up = wire.start("up")
    up.wait_for_line("no terminal here")
    up.interrupt()
    wait_for_none(wire)
    assert "Traceback" not in up.err


def test_a_part_that_hangs_is_killed_and_reported(wire: Wire) -> None:
    up = wire.start("up")
    parts = all_run(wire, PARTS)
    sim = parts["sim"]
    os.kill(sim, signal.SIGSTOP)
    # of two signals that wait, the kernel delivers SIGTERM first
    wait_for(lambda: state_of(sim) == "T")
    assert up.interrupt(AT_MOST) == 0
    assert_ended(parts, wire)
    assert "up: sim did not end within 0.5 s and was killed" in up.err


def test_in_a_terminal_it_shows_the_teleop_and_ctrl_c_ends_all(wire: Wire) -> None:
    terminal = wire.terminal("up")
    robot = Robot(wire.bus())
    terminal.wait_for_text("controller@")
    parts = all_run(wire, {"teleop", *PARTS})

    def teleop_drives() -> bool:
        """And the controller has been silent for a while: it has yielded, and written so."""
        writers = {received.source.partition("@")[0] for received in robot.commands.all()[-20:]}
        drives = "you drive" in terminal.screen() and moves(robot.newest(), -0.5, 0, 0)
        return drives and writers == {"teleop"}

    terminal.hold_until(",", teleop_drives)
    terminal.type("\x03")
    assert terminal.process.wait(AT_MOST) == 0
    assert_ended(parts, wire)
    robot.wait_for_stop_command()
    assert terminal.modes() == terminal.modes_before
    assert "controller: yields to teleop@" in terminal.screen(), (
        "the lines of the others come at the end"
    )
    assert "Traceback" not in terminal.raw


def test_a_terminal_that_is_closed_ends_all_with_a_stop_of_the_robot(wire: Wire) -> None:
    terminal = wire.terminal("up")
    robot = Robot(wire.bus())
    terminal.wait_for_text("controller@")
    driven(robot)
    terminal.hang_up()
    terminal.process.wait()
    wait_for_none(wire)
    robot.wait_for_stop_command()


def test_a_killed_teleop_ends_all_and_leaves_the_terminal_tidy(wire: Wire) -> None:
    terminal = wire.terminal("up")
    terminal.wait_for_text("controller@")
    parts = parts_at(wire)
    os.kill(parts["teleop"], signal.SIGKILL)
    terminal.process.wait()
    assert_ended(parts, wire)
    assert terminal.modes() == terminal.modes_before
    assert terminal.raw.rfind("\x1b[?1049h") < terminal.raw.rfind("\x1b[?1049l")


def broken_robot(folder: Path) -> str:
    path = folder / "broken.urdf"
    path.write_text("<robot name='r'><link name='a'>")
    return str(path)


@pytest.mark.parametrize(
    "start", [Wire.start, Wire.terminal], ids=["without a terminal", "in a terminal"]
)
def test_nothing_starts_beside_a_robot_that_is_broken(
    wire: Wire, tmp_path: Path, start: Callable[..., Process | Terminal]
) -> None:
    started = start(wire, "up", "--robot", broken_robot(tmp_path))
    process = started.process if isinstance(started, Terminal) else started
    assert process.wait() == 1
    shown = started.raw if isinstance(started, Terminal) else started.err
    (line,) = filter(None, map(str.strip, shown.splitlines()))
    assert line.startswith("holozen up: ") and "broken.urdf" in line
    assert parts_at(wire) == {}


def test_nothing_starts_beside_robots_that_no_sim_takes(
    wire: Wire, verb: Verb, tmp_path: Path
) -> None:
    (tmp_path / "still.urdf").write_text(STILL)
    still = str(tmp_path / "still.urdf")
    for robots, reason in (
        ([f"{BOT}=Fred", f"{BOT}=Fred"], "2 robots are called 'Fred'; give each a name"),
        ([BOT, BOT], "2 robots have no name; give each a name"),
        ([still], "still.urdf: no plugin drives it; add one, or move the whole body"),
    ):
        words = [word for robot in robots for word in ("--robot", robot)]
        assert_one_line(verb(wire, "up", *words), 1, "holozen up: ", reason)
    assert parts_at(wire) == {}


def test_a_wrong_flag_is_one_line_and_nothing_starts(wire: Wire, verb: Verb) -> None:
    for words, reason in (
        (["--rtf", "fast"], "--rtf: 'fast': use a number from 0"),
        (["--shape", "sqare"], "'sqare' (did you mean 'square'?)"),
        (["--goals", "nowhere.txt"], "'nowhere.txt': there is no such file"),
        (["--robot", "none.urdf=Fred"], "'none.urdf': there is no such file"),
        (["--laps", "two"], "'two': use a whole number"),
        (["--allow-env", "A=B"], "'A=B': write the name"),
        (["--speed", "1"], "no flag '--speed'"),
        (["--shards", "2", "--robot", f"{BOT}=Fred", "--robot", BOT], "--shards"),
    ):
        assert_one_line(verb(wire, "up", *words), 2, "holozen up: ", reason)


def test_of_several_robots_the_first_is_driven_in_the_engine_of_ones_choice_and_killed_it_leaves_nothing(  # noqa: E501
    wire: Wire,
) -> None:
    up = wire.start("up", "--robot", f"{BOT}=Fred", "--robot", f"{BOT}=Ann", "--engine", "mujoco")
    driven(Robot(wire.bus(), "Fred"))
    Robot(wire.bus(), "Ann").stands()
    assert "mujoco" in Path(f"/proc/{all_run(wire, PARTS)['sim']}/maps").read_text()
    up.kill()
    wait_for_none(wire)


def test_a_killed_sim_is_reported_and_one_started_by_hand_joins_the_others(wire: Wire) -> None:
    up = wire.start("up", "--no-restart")
    robot = Robot(wire.bus())
    driven(robot)
    os.kill(parts_at(wire)["sim"], signal.SIGKILL)
    up.wait_for_line("up: sim was ended by signal 9; `holozen sim` starts it again")
    up.wait_for_line("controller: waiting for odom")
    assert set(parts_at(wire)) == {"up", "pose-service", "controller"}
    start_sim(wire)
    driven(robot)
    up.wait_for_line("controller: continues")


def test_a_part_that_dies_is_started_again_and_moves_no_robot_and_a_signal_ends_all_with_a_stop_of_it(  # noqa: E501
    wire: Wire,
) -> None:
    up = wire.start("up")
    robot = Robot(wire.bus())
    for part, then, holds in (
        (
            "controller",
            "; it drives after `holozen controller --resume` or",
            "controller: yields to --held",
        ),
        (
            "pose-service",
            "; the controller drives after `holozen controller --resume`",
            "controller: yields to --held",
        ),
        (
            "sim",
            ", its robots stopped until `holozen release`",
            "controller: yields: the robot is stopped by",
        ),
    ):
        driven(robot)
        held = up.err.count(holds)
        os.kill(dead := parts_at(wire)[part], signal.SIGKILL)
        up.wait_for_line(f"up: {part} was ended by signal 9; starting it again in 0.5 s{then}")
        wait_for(lambda holds=holds, held=held: up.err.count(holds) > held, what=holds)  # type: ignore[misc]
        wait_for(
            lambda part=part, dead=dead: parts_at(wire).get(part, dead) != dead,  # type: ignore[misc]
            what=f"another {part}",
        )
        robot.stands()
        odoms = robot.odom.from_now()
        robot.pass_time(2.0)
        assert all(map(rests, odoms.messages()))
        if part == "sim":
            assert wire.run("release").returncode == 0
        wait_for(partial(resumed, robot))
    driven(robot)
    parts = all_run(wire, PARTS)
    assert set(parts) == {"up", *PARTS}
    assert up.terminate(AT_MOST) == 0
    assert_ended(parts, wire)
    robot.wait_for_stop_command()
    assert "Traceback" not in up.err


def resumed(robot: Robot) -> bool:
    with contextlib.suppress(ServiceError):
        return bool(robot.resume())
    return False


def test_a_part_that_keeps_dying_is_started_less_and_less_often(wire: Wire) -> None:
    up = wire.start("up")
    for number, pause in enumerate(("0.5", "1", "2"), 1):
        wait_for(lambda number=number: up.err.count("4 goals from square") == number)  # type: ignore[misc]
        os.kill(parts_at(wire)["pose-service"], signal.SIGKILL)
        up.wait_for_line(f"up: pose-service was ended by signal 9; starting it again in {pause} s")
