"""CONTRIBUTING.md is true of the code: files, functions, and the length of the two paths."""

import ast
import re
from itertools import groupby
from pathlib import Path

REPO = Path(__file__).parents[2]
LONGEST = 12  # modules from a key press to a command, and from a command to odometry
ROW = re.compile(r"\| `((?:holozen|services)/\S+\.py)` \| (.+) \|")


def tables() -> list[list[tuple[str, list[str]]]]:
    """The tables of files and their functions."""
    rows = [ROW.fullmatch(line) for line in (REPO / "CONTRIBUTING.md").read_text().splitlines()]
    groups = [list(group) for there, group in groupby(rows, bool) if there]
    return [
        [(row[1], re.findall(r"`([A-Z]\w*(?:\.\w+)?|[a-z]\w*)`", row[2])) for row in group if row] for group in groups
    ]


def defined(path: Path) -> set[str]:
    """The functions, classes and methods of a file."""
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ClassDef | ast.FunctionDef)]
    methods = {
        f"{node.name}.{inner.name}"
        for node in nodes
        if isinstance(node, ast.ClassDef)
        for inner in node.body
        if isinstance(inner, ast.FunctionDef)
    }
    return methods | {node.name for node in nodes}


def test_each_step_of_the_two_paths_exists_and_neither_is_long() -> None:
    paths = tables()
    assert len(paths) == 2
    for path in paths:
        assert len(path) <= LONGEST
        for file, names in path:
            assert names, file
            assert set(names) <= defined(REPO / file), file
