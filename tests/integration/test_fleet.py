"""A hundred robots in one sim, in a long run three hundred: as safe, and as easy to look at, as
one.
"""

import contextlib
import json
import os
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest

from holozen import data
from holozen.messages import Twist
from holozen.testing import Wire, wait_for

from .conftest import SPAWN
from .processes import stopped
from .robots import Robot, speeds

EMPTY = str(data.find("worlds", "empty.world"))
COUNT = 300 if os.environ.get("HOLOZEN_LONG") == "1" else 100
FIRST, LAST = "bot0", f"bot{COUNT - 1}"
NAN = b'{"linear": {"y": NaN}}'
LONG = 120.0  # s for a command line on a machine that is busy


@pytest.fixture(scope="module")
def fleet(town: Wire) -> Wire:
    """A wire with a sim and its robots."""
    # Nothing waits for its time, and it costs less.
    sim = town.start("sim", "--empty", "--rtf", "0.3", "--world", EMPTY)
    sim.wait_for_line("no robot yet", LONG)
    bot = str(data.find("urdf", "hb_bot.urdf.xacro"))
    done = town.run(*SPAWN, bot, "--count", str(COUNT), "--grid", "1.5", within=LONG)
    assert done.stdout == f"{FIRST} .. {LAST} listen on {FIRST}/cmd_vel .. {LAST}/cmd_vel\n", (
        done.stderr
    )
    return town


def test_each_is_listed_drawn_diagnosed_and_driven_by_its_name(fleet: Wire) -> None:
    # Side by side, as the sim takes a core as long as they look.
    def listed(*words: str) -> bool:
        return len(fleet.run(*words, within=LONG).stdout.splitlines()) == COUNT

    def diagnosed() -> bool:
        findings = fleet.run("doctor", within=LONG).stdout
        return f"({COUNT} robots)" in findings and len(findings.splitlines()) < 12

    def all_drawn() -> bool:
        drawn = json.loads(fleet.run("map", "--json", "-w", "2", within=LONG).stdout)
        return len(drawn["robots"]) == COUNT

    looks = (
        partial(listed, "list"),
        partial(listed, "topic", "find", "Odometry"),
        diagnosed,
        all_drawn,
    )
    with ThreadPoolExecutor() as pool:
        for look in [pool.submit(wait_for, look, LONG) for look in looks]:
            look.result()
    with fleet.terminal("teleop", FIRST) as terminal:
        terminal.wait_for_text("listening")

        def next_one() -> bool:
            terminal.type("\t")
            with contextlib.suppress(AssertionError):
                terminal.wait_for_text("holozen teleop   bot1", 2)
                return True
            return False

        wait_for(next_one, LONG)


def test_one_stops_by_itself_obeys_a_person_first_and_is_stopped_alone(fleet: Wire) -> None:
    robot, y = Robot(fleet.bus(), LAST), 0.2  # m/s sideways, where nothing stands beside it
    broken = fleet.bus("broken").publisher(f"{LAST}/cmd_vel", Twist)
    robot.drive(0, y)
    robot.stands()  # after a silence
    robot.drive(0, y)

    def refused_and_stands() -> bool:
        broken.put_bytes(NAN)
        status = robot.status()
        return status.refused.get("malformed", 0) > 0 and status.obeyed == ""

    wait_for(refused_and_stands)
    robot.stands()
    person = Robot(fleet.bus("person"), LAST, "INTERACTIVE_HIGH")

    def person_drives() -> bool:
        robot.put(0, -y)
        person.put(0, y)
        obeyed = robot.status().obeyed
        return obeyed.startswith("person@") and speeds(robot.newest())[1] * y > 0

    wait_for(person_drives)
    done = fleet.run("stop", LAST, "--timeout", "60", within=LONG)
    assert stopped(done.stdout) == [LAST], done.stderr
    robot.stands()
    moved = robot.odom.from_now()
    for _ in range(20):
        person.put(0, y)
        robot.newest()
    assert robot.status().stopped.startswith("stop@")
    assert not any(any(speeds(odom)) for odom in moved.messages())
    other = Robot(robot.bus, "bot17")
    assert other.status().stopped == ""
