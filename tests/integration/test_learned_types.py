"""A type that only its publisher has is shown, echoed and recorded by others."""

import json
from functools import partial
from pathlib import Path

import pytest
from mcap.reader import make_reader

from holozen.testing import Process, Wire, wait_for

from .conftest import comes_to

PACKAGE = {
    "package.xml": "<package><name>cell_msgs</name></package>",
    "msg/Cell.msg": "uint8 FULL=2\nfloat32 volts\nuint8 state 1",
    "msg/Battery.msg": "std_msgs/Header header\nCell[] cells\nstring maker\nbool[2] on",
    "scripts/battery.py": """
import rclpy
from cell_msgs.msg import Battery, Cell

rclpy.init()
node = rclpy.create_node("battery")
publisher = node.create_publisher(Battery, "battery", 10)
node.create_timer(0.05, lambda: publisher.publish(Battery(cells=[Cell(volts=3.5)], maker="here")))
rclpy.spin(node)
""",
}
WANTED = {"cells": [{"volts": 3.5, "state": 1}], "maker": "here", "on": [False, False]}


@pytest.fixture
def battery(wire: Wire, tmp_path: Path) -> Process:
    """A process that publishes a type of a package that lies where no one else looks.

    Another one holds the meeting point: else the first verb might, which leaves it a moment later.
    """
    wire.bus("holder", lasting=True)
    for name, text in PACKAGE.items():
        path = tmp_path / "package" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return wire.start("run", "--wire", "cdr", str(tmp_path / "package/scripts/battery.py"))


def shown(wire: Wire, name: str) -> tuple[str, list[str]]:
    """What `interface show` says of a type: its errors, and its last lines."""
    done = wire.run("interface", "show", name)
    return done.stderr, done.stdout.splitlines()[-6:]


def test_others_learn_it_from_the_publisher(wire: Wire, battery: Process, tmp_path: Path) -> None:
    echoed = wire.run("topic", "echo", "battery", "--once", "--timeout", "20", "--json")
    assert echoed.stderr == ""
    assert json.loads(echoed.stdout).items() >= WANTED.items()

    for name in ("battery", "/battery", "cell_msgs/msg/Battery"):
        comes_to(
            (
                "",
                [
                    "Cell[] cells",
                    "\tuint8 FULL=2",
                    "\tfloat32 volts",
                    "\tuint8 state 1",
                    "string maker",
                    "bool[2] on",
                ],
            ),
            partial(shown, wire, name),
        )

    def recorded() -> bool:
        """False where a busy machine let nothing come within a second."""
        done = wire.run("record", "battery", "-o", str(tmp_path / "bag"), "--max-duration", "1")
        assert done.returncode == 0 or "no messages arrived" in done.stderr, done.stderr
        return done.returncode == 0

    wait_for(recorded)
    with (tmp_path / "bag.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    (schema,) = summary.schemas.values()
    assert schema.name == "cell_msgs/msg/Battery"
    assert b"volts" in schema.data
    assert battery.returncode is None


def test_an_unpublished_key_stays_unknown_in_one_line(wire: Wire) -> None:
    wire.bus("someone", lasting=True)
    done = wire.run("interface", "show", "cell_msgs/msg/Battery")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert "no package 'cell_msgs' with interfaces" in done.stderr
