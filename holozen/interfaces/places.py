"""Where definitions lie: in the tables beside this file, and in the msg and srv folders of packages."""

import functools
import os
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from holozen.interfaces.definition import InterfaceError
from holozen.interfaces.parser import LARGEST_FILE

HERE = os.path.dirname(os.path.abspath(__file__))
KINDS = ("msg", "srv")

Folders = Mapping[str, "str | os.PathLike[str]"]
Paths = Sequence["str | os.PathLike[str]"]


class Source(NamedTuple):
    """The text of a definition, the file it is from, and the line it begins at."""

    text: str
    where: str
    line: int = 1


@functools.cache
def table(package: str) -> dict[str, Source]:
    """The definitions of a package of ours, by `msg/Name`; empty if it is none."""
    path = os.path.join(HERE, f"{package}.txt")
    if not os.path.isfile(path):
        return {}
    with open(path, encoding="utf-8") as file:
        text = file.read()
    found = list(re.finditer(r"^\[(\w+/\w+)\]\n", text, re.MULTILINE))
    ends = [*(heading.start() for heading in found[1:]), len(text)]
    return {
        heading[1]: Source(text[heading.end() : end], path, text.count("\n", 0, heading.end()) + 1)
        for heading, end in zip(found, ends, strict=True)
    }


def tables() -> list[str]:
    """The packages of ours."""
    return sorted(name.removesuffix(".txt") for name in os.listdir(HERE) if name.endswith(".txt"))


class Places:
    """Finds the definitions of packages. `given` are the folders of some of them; the others are looked up once, around
    the files or folders `near` and around the working folder.
    """

    def __init__(self, given: Folders, near: Paths = ()) -> None:
        self._given = {name: os.fspath(folder) for name, folder in given.items()}
        self._near = near
        self._found: dict[str, str | None] = {}

    def source(self, package: str, name: str) -> Source | None:
        """The definition of `name` (such as `msg/Twist`) in a package; None if there is none. Raises InterfaceError."""
        if package not in self._given and (ours := table(package)):
            return ours.get(name)
        path = self.folder(package)
        kind, _, last = name.partition("/")
        return None if path is None else _read(os.path.join(path, kind, f"{last}.{kind}"))

    def names(self, package: str) -> list[str]:
        """The definitions of a package, such as `msg/Twist`. Raises InterfaceError."""
        if package not in self._given and (ours := table(package)):
            return sorted(ours)
        path = self.folder(package)
        found = sorted(_names_in(path)) if path else []
        if package in self._given and not found:
            raise InterfaceError(f"--package {package}={path}: no .msg or .srv files in its folders msg and srv")
        return found

    def packages(self) -> list[str]:
        """Those that are ours or given, and those of the environment that hold definitions."""
        shared = [os.path.join(prefix, "share") for prefix in _environment("AMENT_PREFIX_PATH")]
        for place in (*shared, *_environment("ROS_PACKAGE_PATH")):
            for name in _listed(place):
                path = os.path.join(place, name)
                if re.fullmatch(r"\w+", name) and any(_names_in(path)):
                    self._found.setdefault(name, path)
        return sorted({*tables(), *self._given, *(name for name, path in self._found.items() if path)})

    def folder(self, package: str) -> str | None:
        """Where a package that is not ours lies; None if it is not found. Raises InterfaceError."""
        if package not in self._given:
            if package not in self._found:
                self._found[package] = _look_up(package, self._near)
            return self._found[package]
        path = self._given[package]
        if not os.path.isdir(path):
            raise InterfaceError(f"--package {package}={path}: there is no such folder")
        return path


def _look_up(package: str, near: Paths) -> str | None:
    """The folder of a package that is not ours, looked up as those of robot files are. Raises InterfaceError."""
    from pathlib import Path

    from holozen.robot.packages import find_named, folders_above, folders_below, packages_in

    try:
        starts = [*map(Path, near), Path.cwd()]
        found = next(filter(None, (find_named(package, start) for start in starts)), None)
        below = (each for start in starts if folders_above(start) for each in folders_below(start))
        found = found or packages_in(list(below)).get(package)
    except OSError as error:  # the working folder is gone
        raise InterfaceError(f"package {package}: {error.strerror}") from None
    return str(found) if found else None


def _environment(variable: str) -> list[str]:
    return [part for part in os.environ.get(variable, "").split(os.pathsep) if part]


def _names_in(path: str) -> Iterator[str]:
    for kind in KINDS:
        for name in _listed(os.path.join(path, kind)):
            if re.fullmatch(rf"\w+\.{kind}", name):
                yield f"{kind}/{name.removesuffix('.' + kind)}"


def _listed(path: str) -> list[str]:
    try:
        return os.listdir(path)
    except OSError:
        return []


def _read(path: str) -> Source | None:
    try:
        state = os.stat(path)
        if not stat.S_ISREG(state.st_mode):
            raise InterfaceError(f"{path} is no file")
        with open(path, encoding="utf-8-sig") as file:
            return Source(file.read(LARGEST_FILE + 1), path)
    except FileNotFoundError:
        return None
    except UnicodeDecodeError:
        raise InterfaceError(f"{path}: the text is not UTF-8") from None
    except OSError as error:
        raise InterfaceError(f"cannot read {path}: {error.strerror}") from None
