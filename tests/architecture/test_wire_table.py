"""The one table of the wire agrees with the docstrings of the services and with its page in the
docs.
"""

import ast
import re
from pathlib import Path

from holozen import wire

REPO = Path(__file__).parents[2]
FOLDERS = sorted(
    path.parent
    for path in (*REPO.glob("services/*/__init__.py"), *REPO.glob("extensions/view/__init__.py"))
)
OF_EXTENSIONS = {"view"}  # which may be gone
HANDS = "keys"  # what a person presses; on no wire


def flow(folder: Path) -> tuple[set[str], set[str]]:
    """What a service reads and what it writes or serves, by its docstring `reads -> writes.`"""
    text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
    assert re.fullmatch(r"[a-z_]+(, [a-z_]+)* -> [a-z_]+(, [a-z_]+)*\.", text), (
        f"{folder.name}: {text!r}"
    )
    left, right = text.removesuffix(".").split(" -> ")
    return set(left.split(", ")), set(right.split(", "))


def reads(service: str) -> set[str]:
    return {row.key for row in wire.TOPICS if service in row.readers}


def writes(service: str) -> set[str]:
    topics = {row.key for row in wire.TOPICS if service in row.writers}
    return topics | {row.key for row in wire.SERVICES if row.server == service}


MAIN = {key for folder in FOLDERS for keys in flow(folder) for key in keys}
"""The keys that one sees in the picture of the tree; the table has more."""


def test_a_service_reads_what_is_left_of_its_arrow() -> None:
    for folder in FOLDERS:
        left, _ = flow(folder)
        assert left, folder.name
        assert left <= reads(folder.name) | {HANDS}, folder.name


def test_a_service_writes_or_serves_what_is_right_of_its_arrow() -> None:
    for folder in FOLDERS:
        _, right = flow(folder)
        assert right <= writes(folder.name), folder.name
        assert right == writes(folder.name) & MAIN, f"{folder.name} hides a main key"


def test_the_picture_is_closed() -> None:
    """What one reads, another one writes: from the keys of a person to the wheels and back."""
    written = {key for folder in FOLDERS for key in flow(folder)[1]}
    read = {key for folder in FOLDERS for key in flow(folder)[0]}
    assert read - {HANDS} <= written
    assert {"cmd_vel", "odom"} <= read & written


def test_the_table_names_services_that_there_are() -> None:
    known = {folder.name for folder in FOLDERS} | OF_EXTENSIONS
    named = {name for row in wire.TOPICS for name in (*row.writers, *row.readers)}
    assert named | {row.server for row in (*wire.SERVICES, *wire.ACTIONS)} == known
    assert set(wire.PRIORITY_OF) <= known


def test_the_docs_show_the_table() -> None:
    text = (REPO / "docs" / "wire.md").read_text()
    shown = re.search(r"<!-- wire -->\n(.*)\n<!-- /wire -->", text, re.DOTALL)
    assert shown is not None
    assert shown[1] == wire.table(), "scripts/tables rewrites it"


def test_the_table_has_a_row_for_each_key_with_its_types_ends_rate_and_rule() -> None:
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in wire.table().splitlines()]
    cells = {row[0].strip("`"): row for row in rows if row and row[0].startswith("`")}
    assert set(cells) == {row.key for row in (*wire.TOPICS, *wire.SERVICES, *wire.ACTIONS)}
    assert cells["cmd_vel"][1:4] == [
        "geometry_msgs/msg/Twist (TwistStamped accepted)",
        "teleop, view, controller, anyone -> sim",
        "20 Hz",
    ]
    assert cells["clock"][2] == "sim -> anyone"
    assert cells["odom"][4] == wire.TOPICS[1].rule
    assert cells["next_goal"][1:3] == ["holozen/srv/NextGoal", "pose_service"]
    assert len({len(row) for row in rows[: len(wire.TOPICS) + 2]}) == 1
