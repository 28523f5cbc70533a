"""Processes die and come back; the others carry on, and late ones get in."""

import json
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from functools import partial
from typing import Any

import pytest
import zenoh

from holozen.messages import Odometry, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.transport.errors import BusError

from .conftest import foreign_config, start_sim
from .robots import Robot, moves, place


def test_a_sim_killed_while_driving_and_started_again_stands_until_a_key_is_pressed_again(
    wire: Wire,
) -> None:
    sim = start_sim(wire)
    robot = Robot(wire.bus())
    terminal = wire.terminal("teleop", "--mode", "latch")
    terminal.wait_for_text("listening")
    terminal.hold_until("i", lambda: moves(robot.newest(), 0.5, 0, 0))
    robot.odom.next(lambda odom: moves(odom, 0.5, 0, 0) and place(odom)[0] > 0.1)
    sim.kill()
    terminal.wait_for_text("ODOM IS STALE")
    assert terminal.process.returncode is None
    terminal.wait_for_text("odom was lost: stopped")
    start_sim(wire)
    wait_for(lambda: "ODOM IS STALE" not in terminal.screen())
    assert place(robot.stands()) == pytest.approx((0, 0, 0), abs=1e-3)
    terminal.hold_until("J", lambda: moves(robot.newest(), 0, 0.5, 0))
    terminal.type("k")
    robot.stands()


def test_nodes_meet_whoever_dies(wire: Wire) -> None:
    processes = [start_sim(wire), *(wire.start("pose-service") for _ in range(3))]
    for process in processes[1:]:
        process.wait_for_line("goals")
    for left in (3, 2, 1):
        processes.pop(0).kill()
        wait_for(partial(meet, wire, left), what=f"{left} nodes to meet")
    wire.start("pose-service").wait_for_line("goals")
    wait_for(partial(meet, wire, 2))


def meet(wire: Wire, count: int) -> bool:
    """Whether so many nodes are there for each other."""
    return len(wire.run("node", "list").stdout.split()) == count


def test_nodes_talk_on_whoever_dies_and_late_ones_get_in(wire: Wire) -> None:
    first = wire.start("pose-service")
    first.wait_for_line("goals")
    start_sim(wire)
    robot = Robot(wire.bus())
    robot.drive(0.3)
    first.kill()
    late = wire.start("topic", "echo", "odom", "--once", "--timeout", "20")
    robot.drive(-0.3)
    assert late.wait() == 0


# A bus with what a robot has. It ends by an exception, or after a flood on a peer, given by its
# pid, that hangs.
USER = """
import os, signal, sys
from holozen.bus import Bus
from holozen.transport.connection import Connection
from holozen.messages import Odometry, Twist
where = Connection(connect=(sys.argv[1],), listen=(sys.argv[1],))
with Bus("user", where, lasting=True) as bus:
    odom = bus.latest("odom", Odometry)
    commands = bus.publisher("cmd_vel", Twist)
    odom.wait(0, 10)
    print("ready", flush=True)
    if sys.argv[2] == "raise":
        raise RuntimeError("on purpose")
    os.kill(int(sys.argv[2]), signal.SIGSTOP)
    for _ in range(100_000):
        commands.put(Twist())
print("left", flush=True)
"""


def user(wire: Wire, ends: str) -> Process:
    return Process([sys.executable, "-c", USER, wire.endpoint, ends])


def test_a_process_with_an_open_bus_ends_after_an_exception(wire: Wire) -> None:
    start_sim(wire)
    with user(wire, "raise") as process:
        assert process.wait() == 1
        assert "RuntimeError: on purpose" in process.err
        assert process.out == "ready\n"


def test_a_peer_that_hangs_under_a_flood_holds_nobody_up_who_leaves(wire: Wire) -> None:
    """Zenoh itself waits 10 s for such a peer."""
    sim = start_sim(wire)
    bus = wire.bus()
    odom, commands = bus.latest("odom", Odometry), bus.publisher("cmd_vel", Twist)
    odom.wait(0, 10)
    with user(wire, str(sim.pid)) as process:
        process.wait_for_line("left", within=90)
        assert process.wait() == 0
    for _ in range(20_000):
        commands.put(Twist())
    begin = time.monotonic()
    bus.close()
    assert time.monotonic() - begin < 5.0
    with pytest.raises(BusError):
        bus.subscribe_raw("odom").recv()


ALONE = [
    ("sim", "listens", signal.SIGHUP),
    ("sim", "listens", signal.SIGTERM),
    ("pose-service", "goals", signal.SIGINT),
    ("controller", "goal 0", signal.SIGHUP),
    ("router", "router", signal.SIGINT),
]


def test_every_service_ends_on_a_signal_even_alone(wire: Wire) -> None:
    """tests/core/test_process.py has each signal."""
    with ExitStack() as ends:
        started = [ends.enter_context(Wire()).start(verb) for verb, _, _ in ALONE]
        for process, (_, line, number) in zip(started, ALONE, strict=True):
            process.wait_for_line(line)
            process.signal(number)
        for process, (verb, _, number) in zip(started, ALONE, strict=True):
            assert process.wait() == 0, (verb, number)
            assert "Traceback" not in process.err


def test_a_service_with_its_words_cut_off_ends_quietly(wire: Wire) -> None:
    """Its standard error is no longer read."""
    tail = subprocess.Popen(["true"], stdin=subprocess.PIPE)
    tail.wait()
    assert tail.stdin is not None
    with (
        tail.stdin,
        Process([sys.executable, "-m", "holozen", "sim", *wire.flags], stderr=tail.stdin) as sim,
    ):
        robot = Robot(wire.bus())
        robot.bus.session.put("cmd_vel", b"[]")
        robot.status_when(lambda status: status.refused)
        assert sim.terminate() == 0


def test_a_node_that_is_gone_answers_no_get_with_its_last_command(wire: Wire) -> None:
    start_sim(wire)
    terminal = wire.terminal("teleop", "--mode", "latch")
    terminal.wait_for_text("listening")
    with zenoh.open(foreign_config(wire)) as session:

        def last_commands() -> list[Any]:
            return [
                json.loads(bytes(reply.ok.payload))
                for reply in session.get("cmd_vel", timeout=2)
                if reply.ok
            ]

        terminal.hold_until(
            "i", lambda: [command["linear"]["x"] for command in last_commands()] == [0.5]
        )
        terminal.process.terminate()
        wait_for(lambda: last_commands() == [])
