"""docs/coming-from-ros.md lists the names that scripts find, and they find them."""

import subprocess
from importlib import import_module
from pathlib import Path

import pytest

from holozen.ros.api import table
from holozen.ros.missing import HINTS
from holozen.ros.table import IMPORTED, MODULES, imported
from holozen.testing.wire import command

PAGE = Path(__file__).parents[3] / "docs" / "coming-from-ros.md"


def test_the_table_of_names_is_current() -> None:
    assert f"<!-- api -->\n{table()}\n<!-- /api -->\n" in PAGE.read_text(), "scripts/ros-table writes it anew"


def test_every_row_has_as_many_cells_as_its_head() -> None:
    assert {line.replace("\\|", "").count("|") for line in table().splitlines() if line[:1] == "|"} == {3}


def test_a_script_can_import_every_name(tmp_path: Path) -> None:
    script = tmp_path / "all.py"
    lines = [f"from {module} import {name}" for module, ours in MODULES.items() for name in import_module(ours).__all__]
    lines += [f"from {module} import {name}" for module in IMPORTED for name in imported(module)]
    assert len(lines) > 400
    script.write_text("\n".join([*lines, "print('all')"]))
    done = subprocess.run(command("run", str(script)), capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "all\n", "")


def test_a_star_brings_what_the_module_imports(tmp_path: Path) -> None:
    script = tmp_path / "star.py"
    script.write_text(
        "from rclpy.node import *\nfrom tf2_ros import *\nimport rclpy.publisher, rclpy.parameter\n"
        "assert Publisher is rclpy.publisher.Publisher\n"
        "print(rclpy.parameter.ParameterType.PARAMETER_BOOL, SetParametersResult.__name__, TransformStamped.__name__)\n"
    )
    done = subprocess.run(command("run", str(script)), capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("1 SetParametersResult TransformStamped\n", "")


@pytest.mark.parametrize("name", HINTS)
def test_a_script_that_imports_what_is_not_there_is_told_what_is(tmp_path: Path, name: str) -> None:
    script = tmp_path / "one.py"
    script.write_text(f"import {name}\n")
    done = subprocess.run(command("run", str(script)), capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ModuleNotFoundError: ")
    assert last.endswith(f"{HINTS[name]}; see docs/coming-from-ros.md")
