"""The packages of this process: those of `--package`, and those around the script and the working folder.

`holozen run` and `holozen launch` set them once, before any of the user's code runs.
"""

import os
from collections.abc import Mapping
from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.robot.packages import find_named, folders_above, folders_below, nearest_robot_folder, packages_in
from holozen.suggest import listed, suggest

LEVELS = 3  # of folders below the working folder that are searched
MAX_FOLDERS = 500  # on each level: a home folder has thousands
BUILT = ("build", "install", "log", "node_modules", "__pycache__")  # folders without sources

given: dict[str, Path] = {}
starts: list[Path] = []
stand_ins: dict[str, Path] = {}
"""Packages of ROS that `holozen launch` replaces, with folders that do not exist."""


def use(packages: Mapping[str, Path], *places: Path) -> None:
    """Set the packages of `--package`, and the folders around which others are searched, besides the working folder."""
    given.clear()
    given.update(packages)
    starts[:] = [*places, Path.cwd()]


def find(name: str, nameless: bool = True) -> Path:
    """The folder of a package: where its `package.xml` is, or `<prefix>/share/<name>`. Raises RobotError.

    Otherwise, if `nameless` and no package has a similar name: the nearest folder with a robot but no package.xml.
    """
    for start in starts:
        if found := find_named(name, start, given):
            return found
    if name in stand_ins:
        return stand_ins[name]
    if found := packages_in(_below()).get(name) or _in_working_folder().get(name):
        return found
    known = [*around(), *stand_ins]
    similar = suggest(name, known)
    for start in starts if nameless and not similar else []:  # a repository may be cloned under any name
        folder = nearest_robot_folder(start)
        if folder and not (folder / "package.xml").exists():
            return folder
    hint = similar or f"; packages found: {listed(known)}"
    searched = ", ".join(dict.fromkeys(map(str, starts)))
    raise RobotError(f"no package {name!r} around {searched}{hint}; to give its folder: --package {name[:80]}=DIR")


def around() -> dict[str, Path]:
    """Name -> folder of the given packages and of those around the folders of `use`; the nearest wins."""
    above = [folder for start in starts for folder in folders_above(start)]
    return _in_working_folder() | packages_in([*above, *_below()]) | given


def prefix(folder: Path) -> Path:
    """Where a package is installed: the folder above `share`, or its own folder if it is not installed."""
    return folder.parents[1] if folder.parent.name == "share" else folder


def _in_working_folder() -> dict[str, Path]:
    """The packages up to LEVELS below the working folder, where colcon would find them."""
    found, level = list[Path](), starts[-1:]
    for _ in range(LEVELS):
        level = [child for folder in level for child in _subfolders(folder)][:MAX_FOLDERS]
        found += [folder for folder in level if (folder / "package.xml").is_file()]
        level = [folder for folder in level if not (folder / "package.xml").is_file()]
    return packages_in(found)


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = sorted(entry.name for entry in entries if entry.is_dir(follow_symlinks=False))
    except OSError:
        return []
    is_ignored = (folder / "COLCON_IGNORE").exists()
    return [] if is_ignored else [folder / name for name in names if name[0] != "." and name not in BUILT]


def _below() -> list[Path]:
    return [each for start in starts for each in folders_below(start)]
