"""CONTRIBUTING.md is true of the code: the files and names of its lists."""

import re
from pathlib import Path

from tests.present import EXTENSIONS

REPO = Path(__file__).parents[2]
PAGE = (REPO / "CONTRIBUTING.md").read_text()
PLACEHOLDER = re.compile(r"NAME|NOUN|PACKAGE")
PARTS = PAGE.partition("## How to add")[2].partition("\n## ")[0]


def is_here(text: str) -> bool:
    """Whether the extensions that a text names are in this checkout."""
    return {*re.findall(r"extensions/([a-z]\w*)", text)} <= EXTENSIONS


def lists() -> dict[str, list[str]]:
    """What to add -> its steps, but for those in extensions that were left out."""
    parts = re.split(r"^\*\*([^*]+)\*\*.*$", PARTS, flags=re.M)
    return {
        name: [*filter(is_here, re.findall(r"^\d\. (.+)$", text, flags=re.M))]
        for name, text in zip(parts[1::2], parts[2::2], strict=True)
    }


def test_each_list_names_files_that_exist() -> None:
    found = {name for name, steps in lists().items() if steps}
    assert found == {
        "A verb",
        "A tag of a robot's file",
        "A rule of silence, or of who drives",
        "A drive",
        "A message",
        "An extension",
    }
    paths = set(re.findall(r"`((?:\w+/)+[\w.]+|\w+\.(?:toml|yml))`", PAGE))
    real = {path for path in paths if is_here(path) and not PLACEHOLDER.search(path)}
    assert len(real) > 30
    assert [path for path in sorted(real) if not (REPO / path).exists()] == []


def test_each_name_in_a_step_is_in_a_file_of_that_list() -> None:
    for what, steps in lists().items():
        text = "\n".join(steps)
        files = [
            REPO / path
            for path in re.findall(r"`((?:\w+/)+[\w.]+)`", text)
            if (REPO / path).exists()
        ]
        code = "".join(
            each.read_text()
            for path in files
            for each in ([path] if path.is_file() else path.rglob("*.py"))
        )
        names = set(re.findall(r"`([A-Za-z_]+)`", text)) - {"check", "urdf", "cli"}
        assert [name for name in names if not re.search(rf"\b{name}\b", code)] == [], what
