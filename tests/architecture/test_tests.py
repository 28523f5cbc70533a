"""Each test stands on its own: it imports no other, looks at nothing private, and runs once."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

REPO = Path(__file__).parents[2]
FILES = sorted(REPO.glob("tests/**/*.py"))
NOT_OURS = {"_set_ros_time_is_active", "_linear", "_replace", "_exit"}
"""Names that rclpy, its messages, namedtuple and os give to what is public."""
# the one attribute of a node that is ours and not rclpy's; no script's own has this name
HIDDEN = {"_holozen"}


@cache  # each rule looks at all of them
def nodes(path: Path) -> list[ast.AST]:
    """What the rules look at. Nothing else is kept: a whole tree takes longer to keep than to
    make.
    """
    return [
        node
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        or (isinstance(node, ast.Attribute) and is_private(node.attr))
    ]


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def private_names(path: Path) -> Iterator[str]:
    """Private attributes of anything but `self` and `cls`, and private names that are imported."""
    for node in nodes(path):
        if isinstance(node, ast.Attribute) and is_private(node.attr):
            if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")):
                yield node.attr
        elif isinstance(node, ast.ImportFrom):
            yield from (alias.name for alias in node.names if is_private(alias.name))


def test_no_test_imports_another() -> None:
    for path in FILES:
        for node in nodes(path):
            names = (
                [alias.name for alias in node.names]
                if isinstance(node, ast.Import | ast.ImportFrom)
                else []
            )
            module = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
            for name in (*names, module):
                assert not name.rpartition(".")[2].startswith("test_"), (
                    f"{path.relative_to(REPO)} imports {name}"
                )


def test_no_test_touches_a_private_name() -> None:
    found = {f"{path.relative_to(REPO)}: {name}" for path in FILES for name in private_names(path)}
    assert {place for place in found if place.rpartition(" ")[2] not in NOT_OURS | HIDDEN} == set()


def test_no_test_runs_again_after_a_failure() -> None:
    for name in (
        "pyproject.toml",
        "requirements-dev.lock",
        "scripts/test",
        ".ci/run",
        "tests/conftest.py",
    ):
        text = (REPO / name).read_text()
        for word in ("rerunfailures", "reruns", "flaky", "--last-failed", "pytest-retry"):
            assert word not in text, f"{name}: {word}"


COUNTED = re.compile(r"= len\([\w.]+\.(messages|all)\(\)\)|(?<!self)\.(messages|all)\(\)\[\w+:")


def test_what_is_published_from_now_on_is_known_by_its_time() -> None:
    """A message that was sent before may arrive later: `record.from_now()` leaves it out, a count
    does not.
    """
    for path in FILES:
        if path.name not in (Path(__file__).name, "robots.py"):  # which have it
            found = COUNTED.search(path.read_text())
            assert not found, f"{path.relative_to(REPO)}: {found[0]}; use from_now()"
