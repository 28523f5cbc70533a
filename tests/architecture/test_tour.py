"""docs/tour.md is true of the code: its quotes, its names, and the length of what it asks to be
read.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from textwrap import dedent

from holozen import wire
from tests.pages import STEP

REPO = Path(__file__).parents[2]
PAGE = (REPO / "docs" / "tour.md").read_text()
LONGEST = 5000  # lines
ROW = re.compile(r"^\| `(\S+\.py)` \| (.+) \|$", re.M)
ELSEWHERE = {"planar_move"}  # of Gazebo


def reading_list() -> dict[str, list[str]]:
    """File -> the definitions to read; none means all of it."""
    return {file: re.findall(r"`([\w.]+)`", what) for file, what in ROW.findall(PAGE)}


@cache
def defined(file: str) -> dict[str, tuple[int, int]]:
    """Name -> first and last line of each class, function, method and constant of a file."""
    found = dict[str, tuple[int, int]]()
    for node in ast.parse((REPO / file).read_text()).body:
        end = node.end_lineno or node.lineno
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            found[node.name] = node.lineno, end
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [
                name.id
                for target in targets
                for name in ast.walk(target)
                if isinstance(name, ast.Name)
            ]
            found |= dict.fromkeys(names, (node.lineno, end))
        if isinstance(node, ast.ClassDef):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef):
                    found[f"{node.name}.{inner.name}"] = (
                        inner.lineno,
                        inner.end_lineno or inner.lineno,
                    )
    return found


def quotes() -> Iterator[tuple[str, str, str]]:
    """File, definition or "", and text of each quote."""
    for step in STEP.finditer(PAGE):
        if step["language"] == "py":
            file, _, name = step["title"].partition(": ")
            yield file, name, step["text"]


def source(file: str, name: str) -> list[str]:
    lines = (REPO / file).read_text().splitlines()
    first, last = defined(file)[name] if name else (1, len(lines))
    return lines[first - 1 : last]


def found_after(part: list[str], lines: list[str], start: int) -> int:
    """The line after the first place from `start` on where a part is; -1 if it is nowhere."""
    wanted = dedent("\n".join(part))
    for at in range(start, len(lines) - len(part) + 1):
        if dedent("\n".join(lines[at : at + len(part)])) == wanted:
            return at + len(part)
    return -1


def test_each_quote_is_in_the_code_word_for_word() -> None:
    seen = 0
    for file, name, text in quotes():
        seen += 1
        lines, at = source(file, name), 0
        for part in re.split(r"^\.\.\.\n", text, flags=re.M):
            at = found_after(part.splitlines(), lines, at)
            assert at >= 0, f"{file}: {name} holds no longer\n{part}"
    assert seen > 10


def test_each_name_is_one_of_what_it_asks_to_be_read() -> None:
    listed = reading_list()
    known = {name for file in listed for name in defined(file)} | ELSEWHERE
    known |= {row.key for rows in (wire.TOPICS, wire.SERVICES, wire.ACTIONS) for row in rows}
    prose = STEP.sub("", PAGE)
    names = set(re.findall(r"`([A-Za-z_]\w*(?:\.(?!py\b)\w+)?)`", prose))
    assert len(names) > 40
    assert names - known == set()
    assert [
        path for path in re.findall(r"`(\w+(?:/[\w.]+)+)`", prose) if not (REPO / path).exists()
    ] == ["Fred/cmd_vel"]


def test_what_it_asks_to_be_read_is_there_and_takes_an_afternoon() -> None:
    total = 0
    for file, names in reading_list().items():
        assert set(names) <= defined(file).keys(), file
        total += sum(len(source(file, name)) for name in names or [""])
    assert 3000 < total <= LONGEST
    assert {file for file, _, _ in quotes()} <= reading_list().keys()
