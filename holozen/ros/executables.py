"""What `holozen run` runs: a file, or the executable of a package."""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from holozen.flags import nearest
from holozen.robot.errors import RobotError, listed
from holozen.ros import entry_points, packages

FOLDERS = ("scripts", "{package}", "nodes", "src", "bin")  # where scripts lie in a package's sources
_HEAD = 200  # bytes of a file that tell whether it is a script


class NotFound(ValueError):
    """There is no such file, package or executable, or it is no Python script. One line that says what there is."""


class PackageLost(NotFound):
    """There is no such package."""


@dataclass(frozen=True, slots=True)
class Script:
    """A Python file, run as `__main__`; or `function` of `module`, if that is not empty.

    `root` is the folder where its imports are looked up first.
    """

    path: Path
    root: Path
    module: str = ""
    function: str = ""


def from_file(path: Path) -> Script:
    """A Python file. Raises NotFound."""
    if path.is_dir():
        raise NotFound(f"{path} is a folder; give a Python file, or PACKAGE EXECUTABLE")
    if not path.exists():
        there = sorted(each.name for each in path.parent.glob("*.py")) if path.parent.is_dir() else []
        close = nearest(path.name, there)
        raise NotFound(f"no file {str(path)!r}{close or _there('Python files there', there)}")
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise NotFound(f"cannot read {path}: {error.strerror}") from None
    if path.suffix != ".py" and not _is_python(head):
        raise NotFound(
            f"{path} is no Python script, and only those run here; its first line would be #!/usr/bin/python3"
        )
    path = path.absolute()
    return Script(path, path.resolve().parent)


def find(package: str, name: str, nameless: bool = False) -> Script:
    """The executable `name` of a package, with or without `.py`. Raises NotFound.

    If `nameless`, a folder that says no name of a package is taken for this one too, where it has the executable.
    """
    try:
        return _found(_folder(package, nameless=False), package, name)
    except PackageLost:
        with contextlib.suppress(NotFound):
            if nameless:
                return _found(_folder(package, nameless=True), package, name)
        raise


def _found(folder: Path, package: str, name: str) -> Script:
    declared = _declared(folder)
    if name in declared:
        return _console_script(folder, declared[name], name)
    files = dict(_files(folder, package))
    for wanted in (name, f"{name}.py"):
        if wanted in files:
            return from_file(files[wanted])
    there = sorted({*declared, *files})
    said = "give one" if not name else f"package {package!r} has no executable {name!r}{nearest(name, there)}"
    raise NotFound(f"{said}{_there(f'in {folder} there are', there)}")


def names(package: str) -> list[str]:
    """The executables of a package. Raises NotFound."""
    folder = _folder(package, nameless=False)
    return sorted({*_declared(folder), *(name for name, _ in _files(folder, package))})


def _there(words: str, names: list[str]) -> str:
    return f"; {words}: {listed(names, 20)}"


def _folder(package: str, nameless: bool) -> Path:
    try:
        return packages.find(package, nameless)
    except RobotError as error:
        raise PackageLost(str(error)) from None


def _declared(folder: Path) -> entry_points.Declared:
    try:
        return entry_points.declared(folder)
    except entry_points.SetupError as error:
        raise NotFound(str(error)) from None


def _files(folder: Path, package: str) -> Iterator[tuple[str, Path]]:
    """Name and path of all that may be run, the least wanted first."""
    prefix = packages.prefix(folder)
    for each in (*(folder / part.format(package=package) for part in reversed(FOLDERS)), prefix / "lib" / package):
        try:
            names = sorted(os.listdir(each))
        except OSError:
            continue
        for name in names:
            path = each / name
            runs = name.endswith(".py") or (os.access(path, os.X_OK) and "." not in name)
            if path.is_file() and runs and not name.startswith("__"):
                yield name, path


def _console_script(folder: Path, place: str, name: str) -> Script:
    module, _, function = place.partition(":")
    stem = folder.joinpath(*module.split("."))
    for path in (stem.with_name(f"{stem.name}.py"), stem / "__init__.py"):
        if path.is_file():
            return Script(path.absolute(), folder.absolute(), module, function)
    raise NotFound(f"{folder}: executable {name!r} is {place} in its setup file, but there is no {stem}.py")


def _is_python(head: bytes) -> bool:
    first = head.splitlines()[0] if head else b""
    return b"\0" not in head and first.startswith(b"#!") and b"python" in first
