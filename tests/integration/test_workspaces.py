"""hb_bot out of students' workspaces, spawned and driven over the wire as its plugin has it."""

import math
from pathlib import Path

import pytest

from holozen import entities
from holozen.testing import Wire
from tests.students import MIXED, ROS_2, hb_bot, workspace

from .conftest import SPAWN, Verb
from .robots import Robot, distance, place

BOTS = {
    "with a package.xml, ROS 2": ("ws/src/holo", hb_bot("holo", ROS_2), "holo", "\n"),
    "mixed tags, a frame that is none": (
        "hb_task_1b",
        hb_bot("hb_task_1b", MIXED, frame="chasis"),
        "hb_task_1b",
        "\n",
    ),
}


@pytest.fixture(scope="module")
def empty(town: Wire) -> Wire:
    """A wire with a sim without robots."""
    town.start("sim", "--empty", "--rtf", "4").wait_for_line("no robot yet")
    return town


@pytest.mark.parametrize("bot", BOTS)
def test_it_is_spawned_and_drives_by_its_plugin(
    verb: Verb, empty: Wire, tmp_path: Path, bot: str
) -> None:
    folder, text, package, ends = BOTS[bot]
    file = workspace(tmp_path, folder, text, package, ends)
    done = verb(empty, *SPAWN, str(file), "--name", "Fred")
    assert (done.returncode, done.stdout) == (0, "Fred listens on Fred/cmd_vel\n")
    assert done.stderr.count("\n") == ("chasis" in done.stderr)
    fred = Robot(empty.bus(), "Fred").wait_longer()
    start = fred.stands()
    fred.drive(0.3, 0.4, until=lambda odom: distance(odom, start) > 1)
    end = fred.stop()
    assert math.atan2(place(end)[1], place(end)[0]) == pytest.approx(math.atan2(4, 3), abs=1e-3)
    fred.drive(0, 0, 1, until=lambda odom: place(odom)[2] > 1)
    turned = fred.stop()
    assert distance(end, turned) < 1e-3
    entities.delete(fred.bus, "Fred")
    fred.bus.close()
