"""Several sims on one bus share the robots by name."""

import os
import re
import signal
from functools import partial

import pytest

from holozen import data
from holozen.testing import Process, Wire, wait_for

from .conftest import SPAWN, Verb, comes_to
from .processes import assert_one_line, parts_at, stopped
from .robots import Robot

BOT = data.find("urdf", "hb_bot.urdf.xacro")
OF_FIRST, OF_SECOND = "bot4", "bot0"  # of two shards


@pytest.fixture(scope="module")
def shards(town: Wire) -> tuple[Process, Process]:
    """Two shards with a fleet of six."""
    first, second = (town.start("sim", "--rtf", "0.2", "--shard", f"{one}/2") for one in (1, 2))
    for shard in (first, second):
        shard.wait_for_line("this is shard")
    done = town.run(*SPAWN, str(BOT), "--count", "6", "--grid", "2")
    assert done.stdout == "bot0 .. bot5 listen on bot0/cmd_vel .. bot5/cmd_vel\n", done.stderr
    return first, second


def names(wire: Wire, verb: Verb) -> list[str]:
    return [line.split()[0] for line in verb(wire, "list").stdout.splitlines()]


def spawned(wire: Wire, verb: Verb, name: str) -> bool:
    """Spawn a robot: False where its shard was not discovered in time."""
    done = verb(wire, *SPAWN, str(BOT), "--name", name, "-x", name[-1])
    assert done.returncode == 0 or "which does not run" in done.stderr, done.stderr
    return done.returncode == 0


def test_each_robot_is_in_one_shard_and_all_are_one_world_to_callers(
    town: Wire, shards: tuple[Process, Process], verb: Verb
) -> None:
    comes_to([f"bot{number}" for number in range(6)], lambda: names(town, verb))
    reported = "they are in 2 sims; robots of different sims do not collide\n"
    comes_to(reported, lambda: verb(town, "list").stderr)
    first, second = shards
    for name, here, there in ((OF_FIRST, first, second), (OF_SECOND, second, first)):
        here.wait_for_line(f"sim: {name} was added to the world")
        assert name not in there.err
    done = verb(town, *SPAWN, str(BOT), "--name", OF_SECOND, "-x", "20")
    assert_one_line(done, 1, f"holozen spawn: there is an entity '{OF_SECOND}' already")
    assert "duplicates" not in verb(town, "doctor").stdout


def test_robots_of_all_shards_drive_and_are_stopped_paused_and_reset(
    town: Wire, shards: tuple[Process, Process], verb: Verb
) -> None:
    robots = [Robot(town.bus(), name) for name in (OF_FIRST, OF_SECOND)]
    for robot in robots:
        robot.drive(0.3)
    comes_to(
        [f"bot{number}" for number in range(6)],
        lambda: stopped(verb(town, "stop").stdout),
    )
    for robot in robots:
        robot.stands()
    assert verb(town, "release").returncode == 0
    comes_to("paused\n", lambda: verb(town, "sim", "pause").stdout)
    for shard in shards:
        shard.wait_for_line("sim: set to paused by")
    comes_to("playing\n", lambda: verb(town, "sim", "play").stdout)
    comes_to(0, lambda: verb(town, "sim", "reset").returncode)
    for shard in shards:
        shard.wait_for_line("it was reset")
    assert names(town, verb) == []


REFUSED = {
    "a number that runs": ("1/2", 1, "sim: shard 1/2 runs already; take another: --shard auto/2"),
    "another count": (
        "1/3",
        1,
        "sim: shard 1/2 runs here: all shards have the same N; use --shard auto/2",
    ),
    "none is free": (
        "auto/2",
        1,
        "sim: all 2 shards run already; end them all before you start more of them",
    ),
    "beyond the count": (
        "3/2",
        2,
        "holozen sim: argument --shard: '3/2': give K/N with K from 1 to N and N up to 64",
    ),
    "no number": (
        "x",
        2,
        "holozen sim: argument --shard: 'x' is no shard; give K/N, such as 1/3, or auto/3",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_shard_that_cannot_be_is_refused(
    town: Wire, shards: tuple[Process, Process], verb: Verb, name: str
) -> None:
    shard, code, reason = REFUSED[name]
    done = verb(town, "sim", "--shard", shard)
    assert done.returncode == code and reason in done.stderr, done.stderr
    assert all(process.returncode is None for process in shards)


def test_a_shard_that_is_killed_takes_its_own_robots_alone_and_comes_back_without_them(
    wire: Wire, verb: Verb
) -> None:
    up = wire.start("up", "--shards", "2")
    wait_for(lambda: up.err.count("this is shard") == 2, 30)
    for name in (OF_FIRST, OF_SECOND):
        wait_for(partial(spawned, wire, verb, name), what=name)
    os.kill(parts_at(wire)["sim"], signal.SIGKILL)
    line = up.wait_for_line(
        "starting it again in 0.5 s; the robots that were spawned in this shard are gone"
    )
    number = re.search(r"up: sim (\d)/2 was ended by signal 9", line)
    assert number, line
    gone, left = (OF_FIRST, OF_SECOND) if number[1] == "1" else (OF_SECOND, OF_FIRST)
    Robot(wire.bus(), left).drive(0.3)
    wait_for(lambda: up.err.count("this is shard") == 3, 30)
    # If the meeting point was that of the shard which died, the other one first has to reach the
    # new one.
    comes_to([left], lambda: names(wire, verb))
    wait_for(partial(spawned, wire, verb, gone), what=gone)
    comes_to(sorted([gone, left]), lambda: names(wire, verb))


def test_the_name_of_a_robot_whose_shard_does_not_run_is_refused_until_a_sim_takes_that_number(
    wire: Wire, verb: Verb
) -> None:
    first = wire.start("sim", "--shard", "auto/2")
    first.wait_for_line("this is shard 1/2")
    done = verb(wire, *SPAWN, str(BOT), "--name", OF_SECOND)
    assert_one_line(
        done,
        1,
        f"holozen spawn: '{OF_SECOND}' belongs to shard 2/2, which does not run; start it: "
        "holozen sim --shard",
    )
    second = wire.start(
        "sim", "--shard", "auto/2", "--robot", f"{BOT}={OF_FIRST}", "--robot", f"{BOT}={OF_SECOND}"
    )
    second.wait_for_line("this is shard 2/2")
    comes_to([OF_SECOND], lambda: names(wire, verb))


def test_a_health_check_knows_its_own_shard_and_a_loop_that_does_not_go(
    town: Wire, shards: tuple[Process, ...], verb: Verb
) -> None:
    healthy = re.compile(r"ok +health: sim_1_of_2 \(.*sim_2_of_2 \(.* answers\n")

    def both_answer() -> bool:
        done = verb(town, "doctor", "--health", "sim")
        return done.returncode == 0 and bool(healthy.fullmatch(done.stdout))

    wait_for(both_answer)
    assert verb(town, "doctor", "--health", "controller").stdout.startswith(
        "error    health: no controller of this machine"
    )
    stopped = shards[1]
    stopped.signal(signal.SIGSTOP)
    try:
        assert verb(town, "doctor", "--health", "sim_2_of_2").returncode == 1
    finally:
        stopped.signal(signal.SIGCONT)
