"""Every file, and everything public, has a docstring."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

REPO = Path(__file__).parents[2]
FOLDERS = ("holozen", "services", "extensions", "benchmarks", "examples", "meshes", "tests")
FILES = sorted(path for folder in FOLDERS for path in REPO.glob(f"{folder}/**/*.py"))
CODE = [
    path
    for path in FILES
    if path.relative_to(REPO).parts[0] in ("holozen", "services", "extensions")
]
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef

DOCSTRING = re.compile(r'(#.*\n|\s)*r?"""\s*\S')  # at the top of a file
WITHOUT_DOCSTRING = {"main", "parser"}  # the file's docstring covers them


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
    return (
        not any(part.startswith("_") for part in path.split("."))
        and node.name not in WITHOUT_DOCSTRING
    )


def is_a_message(node: Definition) -> bool:
    """ROS documents it."""
    bases = node.bases if isinstance(node, ast.ClassDef) else []
    return any(
        isinstance(base, ast.Name) and base.id in ("Message", "ActionPart") for base in bases
    )


def is_of_a_protocol(node: Definition) -> bool:
    """A body of `...`: implementations have the docstring."""
    last = node.body[-1]
    return (
        isinstance(last, ast.Expr)
        and isinstance(last.value, ast.Constant)
        and last.value.value is ...
    )


def methods_of_protocols(tree: ast.Module) -> set[str]:
    """`Class.method` of each method of a protocol, which documents it for the classes that derive
    from it.
    """
    return {
        place
        for place, node in definitions(tree)
        if "." in place and is_of_a_protocol(node) and ast.get_docstring(node)
    }


def inherited(tree: ast.Module, place: str) -> set[str]:
    """`Class.method` of each class from which a method may be."""
    kind, _, method = place.rpartition(".")
    bases = [
        base
        for path, node in definitions(tree)
        if path == kind and isinstance(node, ast.ClassDef)
        for base in node.bases
    ]
    return {f"{base.id}.{method}" for base in bases if isinstance(base, ast.Name)}


def test_every_file_has_a_docstring() -> None:
    texts = {name(path): path.read_text() for path in FILES}
    assert [where for where, text in texts.items() if text and not DOCSTRING.match(text)] == []


def test_what_is_public_has_a_docstring() -> None:
    documented = set[str]()
    bare = dict[str, set[str]]()
    for path in CODE:
        tree = ast.parse(path.read_text())  # not kept, which takes longer than to make it
        documented |= methods_of_protocols(tree)
        bare |= {
            f"{name(path)}: {place}": inherited(tree, place)
            for place, node in definitions(tree)
            if is_public(place, node) and not ast.get_docstring(node)
            if not is_a_message(node) and not is_of_a_protocol(node)
        }
    assert [where for where, protocols in bare.items() if not protocols & documented] == []
