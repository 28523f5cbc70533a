"""Keys in a pseudo-terminal become commands on the wire, and the robot moves."""

import contextlib
from collections.abc import Iterator

import pytest

from holozen import entities
from holozen.messages import TwistStamped
from holozen.spawning import SpawnPose, spawn_file
from holozen.testing import Terminal, Wire, wait_for

from .conftest import Verb
from .robots import URDF, Robot, moves, place, planar

V, W = 0.4, 0.8  # m/s, rad/s
ESCAPE = "\x1b"


@pytest.fixture(scope="module")
def shared_teleop(town: Wire, only_robot: Robot) -> Iterator[Terminal]:
    """A teleop at 0.4 m/s and 0.8 rad/s whose keys stay pressed, for tests of what a key
    commands.
    """
    with town.terminal(
        "teleop", "--speed", str(V), "--turn", str(W), "--mode", "latch"
    ) as terminal:
        terminal.wait_for_text("listening")
        yield terminal


def start_teleop(wire: Wire, *flags: str) -> Terminal:
    terminal = wire.terminal("teleop", *flags)
    terminal.wait_for_text("listening")
    return terminal


def after(robot: Robot, terminal: Terminal, key: str) -> tuple[float, ...]:
    """The first command that is not a stop after the key was pressed on a robot that stands:
    pressed again where it came while the teleop was held up, and so does not count.
    """
    robot.knows("teleop")
    commands = robot.commands
    part = commands.from_now()

    def pressed() -> object:
        terminal.type(key)
        with contextlib.suppress(AssertionError):
            return part.next(lambda command: any(planar(command)), within=3.0)
        return None

    return planar(wait_for(pressed))  # type: ignore[arg-type]


def test_a_key_press_in_a_terminal_moves_the_robot(town: Wire, robot: Robot) -> None:
    with start_teleop(town) as terminal:
        start, commands = robot.newest(), robot.commands.from_now()

        def has_moved() -> bool:
            newest = robot.newest()
            return moves(newest, 0.5, 0, 0) and place(newest)[0] > place(start)[0] + 0.1

        terminal.hold_until("i", has_moved)
        wait_for(commands.all, what="the command, which may come after the odometry that it caused")
        assert {received.priority for received in commands.all()} == {"INTERACTIVE_HIGH"}
        end = robot.stands()
        assert place(end)[1] == pytest.approx(place(start)[1], abs=1e-3)


def test_where_nothing_shows_that_a_terminal_hangs_a_key_counts_for_5_s(
    town: Wire, robot: Robot
) -> None:
    """These terminals answer no query."""
    spawn_file(town.bus(), URDF / "hb_bot.urdf.xacro", "Fred", SpawnPose(y=5.0))
    fred = Robot(town.bus(), "Fred")
    with (
        start_teleop(town, "--mode", "latch") as latched,
        start_teleop(town, "Fred", "--key-timeout", "3600") as held,
    ):
        both = ((latched, robot), (held, fred))
        for terminal, driven in both:
            terminal.wait_for_text("5 s in a terminal that does not answer")
            after(driven, terminal, "i")
            terminal.freeze()
        for terminal, driven in both:
            driven.wait_for_stop_command()
            driven.stands()
            terminal.thaw()
            terminal.wait_for_text(
                "in a terminal that does not answer a key counts for 5 s: press it again"
            )
    entities.delete(robot.bus, "Fred")


@pytest.mark.parametrize("key", ["k", f"{ESCAPE}[15~"])
def test_k_and_every_unknown_key_stop_the_robot(
    shared_teleop: Terminal, robot: Robot, key: str
) -> None:
    shared_teleop.hold_until("i", lambda: moves(robot.newest(), V, 0, 0))
    shared_teleop.type(key)
    robot.wait_for_stop_command()
    robot.stands()


def test_without_another_key_the_robot_stops_after_the_key_timeout(
    town: Wire, robot: Robot
) -> None:
    with start_teleop(town, "--key-timeout", "0.2") as terminal:
        commands = robot.commands.from_now()
        after(robot, terminal, "i")
        robot.wait_for_stop_command()
        # At 20 Hz; after the default of 0.5 s it would be ten of them and more.
        assert sum(any(planar(command)) for command in commands.messages()) <= 6


def test_a_repeat_rate_of_zero_sends_a_command_once(town: Wire, robot: Robot) -> None:
    with start_teleop(town, "--repeat-rate", "0", "--mode", "latch") as terminal:

        def sends_it_once() -> bool:
            """Or stops too, where a busy machine lets it lose sight of the robot."""
            commands = robot.commands.from_now()
            after(robot, terminal, "i")
            robot.pass_time(0.4)
            sent = [planar(command) for command in commands.messages()]
            terminal.type("k")
            robot.wait_for_stop_command()
            robot.stands()
            return sent == [(0.5, 0, 0, 0)]

        wait_for(sends_it_once, what="one command alone")


def test_stamped_commands_carry_time_and_frame_and_drive_too(town: Wire, robot: Robot) -> None:
    with start_teleop(town, "--stamped", "--frame-id", "base_link") as terminal:
        commands = robot.commands.from_now()
        terminal.hold_until("J", lambda: moves(robot.newest(), 0, 0.5, 0) and commands.messages())
        command = commands.messages()[0]
        assert isinstance(command, TwistStamped)
        assert command.header.frame_id == "base_link"
        assert command.header.stamp.sec > 0


def test_the_teleop_shows_what_a_robot_cannot_do_and_the_limits_that_the_sim_has(
    wire: Wire,
) -> None:
    wire.start("sim", "--robot", str(URDF / "differential.urdf.xacro")).wait_for_line("listens on")
    terminal = start_teleop(wire, "--mode", "latch")
    terminal.wait_for_text("limit 5")
    assert "1000" not in terminal.screen()
    wait_for(  # a busy sim may be discovered late
        lambda: wire.run("param", "set", "sim", "max_linear", "0.2").returncode == 0
    )
    terminal.wait_for_text("limit 0.2")
    terminal.hold_until(
        "i", lambda: "limit: the robot is driven at no more than 0.2 m/s" in terminal.screen()
    )
    terminal.hold_until("J", lambda: "this robot cannot strafe" in terminal.screen())
    terminal.type("k")
    wait_for(lambda: "cannot strafe" not in terminal.screen())


def test_a_robot_has_one_name_in_list_map_teleop_and_doctor(
    town: Wire, robot: Robot, verb: Verb
) -> None:
    with start_teleop(town) as terminal:
        terminal.wait_for_text("holozen teleop   hb_bot")
    wait_for(lambda: verb(town, "list").stdout.startswith("hb_bot "))
    wait_for(lambda: "hb_bot x " in verb(town, "map", "--once").stdout)
    wait_for(lambda: "nothing commands hb_bot now; " in verb(town, "doctor").stdout)
