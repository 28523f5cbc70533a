"""The packages of this process: what `--package` gave, and what lies around the script and the working folder.

`holozen run` and `holozen launch` set them once, before a line of the user's code runs.
"""

from collections.abc import Mapping
from pathlib import Path

from holozen.robot.errors import RobotError, listed, near
from holozen.robot.packages import find_named, folders_above, folders_below, nearest_robot_folder, packages_in

given: dict[str, Path] = {}
starts: list[Path] = []
stand_ins: dict[str, Path] = {}
"""Packages of ROS that `holozen launch` stands in for, and folders that are only names: nothing is there to be read."""


def use(packages: Mapping[str, Path], *places: Path) -> None:
    """Set the packages of `--package`, and the folders around which others are looked for, besides the working one."""
    given.clear()
    given.update(packages)
    starts[:] = [*places, Path.cwd()]


def find(name: str, nameless: bool = True) -> Path:
    """The folder of a package: where its `package.xml` is, or `<prefix>/share/<name>`. Raises RobotError.

    Else, if `nameless`, and no package is called nearly so: the nearest folder with a robot that says no name.
    """
    for start in starts:
        if found := find_named(name, start, given):
            return found
    if name in stand_ins:
        return stand_ins[name]
    if found := packages_in(_below()).get(name):
        return found
    known = [*around(), *stand_ins]
    meant = near(name, known)
    for start in starts if nameless and not meant else []:  # a repository may be cloned under any name, and say none
        folder = nearest_robot_folder(start)
        if folder and not (folder / "package.xml").exists():
            return folder
    hint = meant or f"; packages found: {listed(known)}"
    looked = ", ".join(dict.fromkeys(map(str, starts)))
    raise RobotError(f"no package {name!r} around {looked}{hint}; say where it is: --package {name[:80]}=DIR")


def around() -> dict[str, Path]:
    """Name -> folder of the packages given, and of those around the places of `use`; the nearest wins."""
    above = [folder for start in starts for folder in folders_above(start)]
    return packages_in([*above, *_below()]) | given


def prefix(folder: Path) -> Path:
    """Where a package is installed: above `share` if there is one, else its own folder."""
    return folder.parents[1] if folder.parent.name == "share" else folder


def _below() -> list[Path]:
    return [each for start in starts for each in folders_below(start)]
