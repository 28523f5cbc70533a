"""The core stands without any extension: none of its imports, and no row of the table of verbs,
needs one.
"""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from holozen.cli import table

REPO = Path(__file__).parents[2]
EXTENSIONS = {
    path.parent.name: path.parent for path in sorted(REPO.glob("extensions/*/__init__.py"))
}
PACKAGES = {f"holozen.{name}" for name in EXTENSIONS}
CORE = [
    path for folder in ("holozen", "services") for path in sorted(REPO.glob(f"{folder}/**/*.py"))
]


@cache  # each rule looks at all of them
def imported(path: Path) -> tuple[tuple[int, str], ...]:
    """(level, module) of each import of a file, names that may be modules included."""
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.level, node.module or ""
            yield from ((node.level, f"{node.module or ''}.{alias.name}") for alias in node.names)


def extensions_of(path: Path) -> set[str]:
    """The extensions that a file imports by their full names."""
    packages = {".".join(module.split(".")[:2]) for level, module in imported(path) if not level}
    return {package.removeprefix("holozen.") for package in packages & PACKAGES}


def test_the_core_imports_no_extension() -> None:
    assert {
        path.relative_to(REPO).as_posix(): found for path in CORE if (found := extensions_of(path))
    } == {}


@pytest.mark.parametrize("name", EXTENSIONS)
def test_an_extension_imports_another_only_where_its_readme_names_it(name: str) -> None:
    line = re.search(
        r"^- Other extensions: (.*)$", (EXTENSIONS[name] / "README.md").read_text(), re.M
    )
    assert line, "its README names the other extensions that it needs, or none"
    files = EXTENSIONS[name].glob("**/*.py")
    named = set(re.findall(r"`(\w+)`", line[1]))
    assert set[str]().union(*map(extensions_of, files)) - {name} == named & EXTENSIONS.keys()


@pytest.mark.parametrize("name", EXTENSIONS)
def test_no_relative_import_leaves_an_extension(name: str) -> None:
    for path in EXTENSIONS[name].glob("**/*.py"):
        deepest = len(path.relative_to(EXTENSIONS[name]).parts)
        assert all(level <= deepest for level, _ in imported(path)), path


def test_each_verb_of_the_table_is_in_the_core_or_in_one_extension() -> None:
    for verb, row in table.VERBS.items():
        path = row.module.removeprefix("holozen.").replace(".", "/")
        homes = [
            folder
            for folder in ("holozen", "services", "extensions")
            if (REPO / folder / f"{path}.py").exists()
        ]
        gone = row.package.removeprefix("holozen.") not in {*EXTENSIONS, "cli"} and not homes
        assert len(homes) == 1 or gone, f"{verb}: {row.module}"


@pytest.mark.parametrize("name", EXTENSIONS)
def test_an_extension_says_what_its_verbs_are(name: str) -> None:
    readme = (EXTENSIONS[name] / "README.md").read_text()
    verbs = [verb for verb, row in table.VERBS.items() if row.package == f"holozen.{name}"]
    assert verbs
    for verb in verbs:
        assert f"`{verb}`" in readme


def test_each_extra_of_the_table_can_be_installed() -> None:
    extras = tomllib.loads((REPO / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert {row.extra for row in table.VERBS.values()} - {""} <= extras.keys()


def test_neither_transport_nor_a_service_knows_the_table_of_verbs() -> None:
    for path in CORE:
        if path.is_relative_to(REPO / "services") or path.is_relative_to(
            REPO / "holozen" / "transport"
        ):
            assert not [
                module for _, module in imported(path) if module.startswith("holozen.cli")
            ], path
