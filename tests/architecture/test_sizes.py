"""A file has at most 250 lines, a function 40, and what is public says what it does."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
FOLDERS = ("holozen", "services", "benchmarks", "examples", "meshes", "tests")
FILES = sorted(path for folder in FOLDERS for path in REPO.glob(f"{folder}/**/*.py"))
CODE = [path for path in FILES if path.relative_to(REPO).parts[0] in ("holozen", "services")]
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
Function = ast.FunctionDef | ast.AsyncFunctionDef

WITHOUT_DOCSTRING = {"main", "parser"}  # the file's first line says it


def name(path: Path) -> str:
    return path.relative_to(REPO).as_posix()


def definitions(tree: ast.Module) -> Iterator[tuple[str, Definition]]:
    """(path, node) of each class and function that is not inside a function."""
    waiting: list[tuple[str, ast.Module | ast.ClassDef]] = [("", tree)]
    while waiting:
        prefix, parent = waiting.pop()
        for node in parent.body:
            if isinstance(node, Definition):
                yield f"{prefix}{node.name}", node
            if isinstance(node, ast.ClassDef):
                waiting.append((f"{prefix}{node.name}.", node))


def is_public(path: str, node: Definition) -> bool:
    return not any(part.startswith("_") for part in path.split(".")) and node.name not in WITHOUT_DOCSTRING


def says_its_name_in_ros(node: Definition) -> bool:
    """A message that is one of ROS is documented there."""
    targets = [statement.target for statement in node.body if isinstance(statement, ast.AnnAssign)]
    return any(isinstance(target, ast.Name) and target.id == "ROS" for target in targets)


def is_of_a_protocol(node: Definition) -> bool:
    """A body of `...`: who implements it says what it does."""
    last = node.body[-1]
    return isinstance(last, ast.Expr) and isinstance(last.value, ast.Constant) and last.value.value is ...


@pytest.mark.parametrize("path", CODE, ids=name)
def test_a_file_of_code_has_at_most_250_lines(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 250


@pytest.mark.parametrize("path", FILES, ids=name)
def test_a_function_has_at_most_40_lines(path: Path) -> None:
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, Function)]
    long = {node.name: node.end_lineno - node.lineno + 1 for node in nodes if node.end_lineno}
    assert {name: lines for name, lines in long.items() if lines > 40} == {}


@pytest.mark.parametrize("path", FILES, ids=name)
def test_a_file_says_what_it_is(path: Path) -> None:
    text = path.read_text()
    assert not text or ast.get_docstring(ast.parse(text))


@pytest.mark.parametrize("path", CODE, ids=name)
def test_what_is_public_has_a_docstring(path: Path) -> None:
    bare = [
        place
        for place, node in definitions(ast.parse(path.read_text()))
        if is_public(place, node) and not ast.get_docstring(node)
        if not says_its_name_in_ros(node) and not is_of_a_protocol(node)
    ]
    assert bare == []
