"""An attribute or module of ROS that does not exist here raises an error with a hint."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from holozen.ros import generated, rclpy
from holozen.ros.catalog import HINTS, MODULES, REEXPORTS
from holozen.ros.rclpy.logging import get_logger
from holozen.ros.rclpy.qos import QoSProfile
from holozen.ros.rclpy.task import Future
from holozen.ros.rclpy.time import Duration, Time
from holozen.ros.tf2_ros.buffer import Buffer
from holozen.testing import Wire
from holozen.testing.wire import command

PAGE = "docs/coming-from-ros.md"
OBJECTS = {
    "Time": (Time(), "to_mesg", "to_msg"),
    "Duration": (Duration(), "nanosecond", "nanoseconds"),
    "RcutilsLogger": (get_logger("a"), "warnn", "warn"),
    "QoSProfile": (QoSProfile(depth=1), "dept", "depth"),
    "Future": (Future(), "results", "result"),
    "Buffer": (Buffer(), "lookup_transforms", "lookup_transform"),
}


def lacks(something: Any, name: str) -> str:
    with pytest.raises(AttributeError) as error:
        getattr(something, name)
    assert (error.value.name, hasattr(something, name)) == ("", False), (
        "Python would guess once more"
    )
    return str(error.value)


def test_the_nearest_name_and_the_page_are_reported() -> None:
    for kind in OBJECTS:
        something, name, nearest = OBJECTS[kind]
        message = (
            f"{kind!r} object has no attribute {name!r} (did you mean {nearest!r}?); what "
            f"{kind} has here: {PAGE}"
        )
        assert lacks(something, name) == message
        assert (
            lacks(something, "zzz")
            == f"{kind!r} object has no attribute 'zzz'; what {kind} has here: {PAGE}"
        )
        assert lacks(something, "_zzz") == f"{kind!r} object has no attribute '_zzz'"


def test_an_error_names_the_scripts_own_subclass_of_node(ros: Wire) -> None:
    class Robot(rclpy.Node):
        pass

    robot = Robot("robot")
    assert lacks(robot, "create_subscriber").startswith(
        "'Robot' object has no attribute 'create_subscriber' (did you mean "
        "'create_subscription'?); what Node has here"
    )
    assert lacks(robot, "handle").endswith(f"; see {PAGE}")


def test_an_error_suggests_to_msg_for_a_time_in_a_stamp() -> None:
    with pytest.raises(AssertionError, match=r"; append \.to_msg\(\)$"):
        generated.find("std_msgs/msg/Header")(stamp=Time())


REPO = Path(__file__).parents[3]
DOCS_PAGE = REPO / "docs" / "coming-from-ros.md"


@pytest.fixture(scope="module")
def table() -> str:
    """The table that scripts/tables writes."""
    script = [sys.executable, "-m", "scripts.table_of_ros"]
    return subprocess.run(script, cwd=REPO, capture_output=True, text=True, check=True).stdout


def test_the_table_of_names_is_current(table: str) -> None:
    assert f"<!-- api -->\n{table}<!-- /api -->\n" in DOCS_PAGE.read_text(), (
        "scripts/tables rewrites it"
    )


def test_every_row_has_as_many_cells_as_its_head(table: str) -> None:
    assert {
        line.replace("\\|", "").count("|") for line in table.splitlines() if line[:1] == "|"
    } == {3}


def test_a_script_can_import_every_name(tmp_path: Path) -> None:
    script = tmp_path / "all.py"
    lines = [
        f"from {module} import {name}"
        for module, ours in MODULES.items()
        for name in import_module(ours).__all__
    ]
    lines += [
        f"from {module} import {name}" for module, names in REEXPORTS.items() for name in names
    ]
    assert len(lines) > 400
    script.write_text("\n".join([*lines, "print('all')"]))
    done = subprocess.run(command("run", str(script)), capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "all\n", "")


def test_a_star_brings_what_the_module_imports(tmp_path: Path) -> None:
    script = tmp_path / "star.py"
    script.write_text(
        "from rclpy.node import *\nfrom tf2_ros import *\nimport rclpy.publisher, rclpy.parameter\n"
        "assert Publisher is rclpy.publisher.Publisher\n"
        "print(rclpy.parameter.ParameterType.PARAMETER_BOOL, SetParametersResult.__name__, "
        "TransformStamped.__name__)\n"
    )
    done = subprocess.run(command("run", str(script)), capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("1 SetParametersResult TransformStamped\n", "")


def test_an_import_that_does_not_exist_here_is_answered_with_a_hint(tmp_path: Path) -> None:
    script = tmp_path / "all.py"
    tries = [
        f"try:\n    import {name}\nexcept ModuleNotFoundError as error:\n    print(error)\n"
        for name in HINTS
    ]
    script.write_text("".join(tries))
    done = subprocess.run(command("run", str(script)), capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    for hint, expected in zip(HINTS.values(), done.stdout.splitlines(), strict=True):
        assert expected.endswith(f"{hint}; see docs/coming-from-ros.md")
