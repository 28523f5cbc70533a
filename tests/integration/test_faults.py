"""Robots that cannot be: each ends in one line, and the sim goes on."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from holozen import entities
from holozen.bus import Bus
from holozen.messages import Clock
from holozen.messages.simulation_interfaces import SpawnEntityReply, SpawnEntityRequest
from holozen.testing import Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.transport.pubsub import Latest

from .conftest import SPAWN
from .processes import assert_one_line

LIMIT = 60.0  # s for `holozen spawn` on a busy machine
INERTIAL = '<inertial><mass value="{}"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
BALL = '<collision><geometry><sphere radius="{}"/></geometry></collision>'
MESH = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
DRIVE = '<gazebo><plugin name="p" filename="libgazebo_ros_planar_move.so"/></gazebo>'
XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'


@pytest.fixture(scope="module")
def bus(town: Wire) -> Iterator[Bus]:
    """A bus beside a sim without robots."""
    town.start("sim", "--empty").wait_for_line("no robot yet")
    yield town.bus()


@contextmanager
def keeps_its_step(bus: Bus) -> Iterator[None]:
    """The sim keeps its step during that: at least seven tenths of that of another one, which has
    nothing to do.
    """
    with Wire() as idle:
        idle.start("sim", "--empty").wait_for_line("no robot yet")
        mine, other = (each.latest("clock", Clock) for each in (bus, idle.bus()))
        began, before = newest(mine), newest(other)
        yield
        assert newest(mine) - began > 0.7 * (newest(other) - before) - 0.2


def newest(clock: Latest[Clock]) -> float:
    """The sim time in seconds, as published after this call."""
    count = clock.count
    wait_for(lambda: clock.count > count + 5)
    reported = clock.read()[0]
    assert reported
    return reported.clock.seconds()


def robot(body: str) -> str:
    return f'<robot name="r">{body}</robot>'


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(parent: str, child: str) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{parent}_{child}" type="fixed">{ends}</joint>'


LAUGHS = "<!DOCTYPE r [<!ENTITY a 'ha'>" + "".join(
    f"<!ENTITY {b} '{f'&{a};' * 10}'>" for a, b in zip("abcdefghi", "bcdefghij", strict=True)
)
FAULTS: dict[str, tuple[str, str]] = {
    "an empty file": ("", "the file is empty"),
    "an unclosed tag": ('<robot name="r">\n<link name="a">', "line 2: broken XML"),
    "a cycle": (robot(link("a") + link("b") + joint("a", "b") + joint("b", "a")), "loop"),
    "two roots": (robot(link("a") + link("b")), "2 root links"),
    "a duplicate link": (robot(link("a") + link("a")), "is defined twice"),
    "a mass of nan": (robot(link("a", INERTIAL.format("nan"))), "'nan' is not a finite number"),
    "a mass below zero": (robot(link("a", INERTIAL.format("-1"))), "is negative"),
    "a mass of abc": (robot(link("a", INERTIAL.format("abc"))), "'abc' is not a finite number"),
    "a radius of zero": (
        robot(link("a", INERTIAL.format(1) + BALL.format(0))),
        "each number must be",
    ),
    "billion laughs": (f"{LAUGHS}]><robot name='&j;'/>", "entity"),
    "an external entity": (
        '<!DOCTYPE r [<!ENTITY a SYSTEM "/etc/passwd">]><robot name="r">&a;</robot>',
        "entity",
    ),
    "macros without end": (
        XACRO.format('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>'),
        "without end",
    ),
    "9**9**9": (XACRO.format('<link name="${9**9**9}"/>'), "9**9**9"),
}


def test_an_impossible_robot_is_one_error_line(town: Wire, bus: Bus, tmp_path: Path) -> None:
    """Errors in the others are reported in the same way by the same reader."""
    text, reported = FAULTS["an unclosed tag"]
    file = tmp_path / "r.urdf"
    file.write_text(text)
    ended = town.run(*SPAWN, str(file), "--name", "Fred", within=LIMIT)
    assert_one_line(ended, 1, str(file), reported)


def triangles(count: int, bad: float) -> bytes:
    """A binary STL with a bad number."""
    corners = np.random.default_rng(1).random((count, 12), dtype=np.float32)
    corners[0, 3] += bad
    records = np.zeros(count, dtype=[("numbers", "<f4", 12), ("attribute", "<u2")])
    records["numbers"] = corners
    return bytes(80) + struct.pack("<I", count) + records.tobytes()


def test_an_unusable_mesh_is_one_warning_and_the_robot_stands_on_a_box(
    town: Wire, bus: Bus, tmp_path: Path
) -> None:
    (tmp_path / "part.stl").write_bytes(triangles(10, float("nan")))
    file = tmp_path / "r.urdf"
    file.write_text(robot(link("a", INERTIAL.format(1) + MESH.format("part.stl")) + DRIVE))
    ended = town.run(*SPAWN, str(file), "--name", "Fred", within=3 * LIMIT)
    assert (ended.returncode, ended.stdout) == (0, "Fred listens on Fred/cmd_vel\n")
    (line,) = ended.stderr.splitlines()
    assert "part.stl" in line and "finite" in line
    entities.delete(bus, "Fred")
    assert town.run(*SPAWN, str(file), "--strict", within=3 * LIMIT).returncode == 1


def test_four_hundred_links_are_a_robot_like_any_other(
    town: Wire, bus: Bus, tmp_path: Path
) -> None:
    names = [f"l{number}" for number in range(400)]
    links = "".join(link(name, INERTIAL.format(0.01) + BALL.format(0.1)) for name in names)
    joints = "".join(joint("l0", name) for name in names[1:])
    (tmp_path / "r.urdf").write_text(robot(links + joints + DRIVE))
    ended = town.run(*SPAWN, str(tmp_path / "r.urdf"), "--name", "Fred", within=LIMIT)
    assert (ended.returncode, ended.stdout, ended.stderr) == (
        0,
        "Fred listens on Fred/cmd_vel\n",
        "",
    )
    entities.delete(bus, "Fred")


RAW = {fault: text for fault, (text, _) in FAULTS.items()} | {
    "200 000 links": robot(link("a") * 200_000),
    "elements without end": "<robot>" + "<a>" * 300_000,
    "fifteen million bytes": robot("x" * 15_000_000),
    "a file of this machine": robot(link("a", INERTIAL.format(1) + MESH.format("/etc/passwd"))),
    "three thousand shapes": robot(link("a", INERTIAL.format(1) + BALL.format(1) * 3000)),
}


@pytest.mark.alone
def test_what_comes_over_the_wire_is_refused_in_one_line_or_harmless_and_the_sim_keeps_its_step(
    bus: Bus,
) -> None:
    with keeps_its_step(bus):
        for fault, text in RAW.items():
            request = SpawnEntityRequest("Fred", resource_string=text)
            try:
                assert (
                    bus.call("spawn_entity", request, SpawnEntityReply, timeout=LIMIT).entity_name
                    == "Fred"
                )
                entities.delete(bus, "Fred")
                assert fault == "a file of this machine"
            except ServiceError as error:
                assert str(error).isprintable() and len(str(error)) < 1000, fault
