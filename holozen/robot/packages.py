"""Where a ROS package lies, on a machine that need not have ROS."""

import os
import re
import stat
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from itertools import takewhile
from pathlib import Path

from holozen.robot.errors import RobotError, cut, listed, near

PACKAGE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
MOST = 200  # folders below a workspace in which packages are looked for
_LARGEST = 1_000_000  # bytes of a package.xml


def find_package(name: str, start: Path, given: Mapping[str, Path] = {}) -> Path:
    """The folder of package `name`, for a robot file (or folder) `start`.

    Looked up in this order: `given` (`--package NAME=DIR`); `<prefix>/share/<name>` of AMENT_PREFIX_PATH,
    then ROS_PACKAGE_PATH; a package.xml with that name in the folders above `start` and their children; last
    the nearest folder above `start` that has a `urdf` folder, since a repository may be cloned under any
    name.

    Raises RobotError that names the packages found and the places searched.
    """
    found = find_named(name, start, given) or nearest_robot_folder(start)
    if found is None:
        raise RobotError(_unknown(name, start, given))
    return found


def find_named(name: str, start: Path, given: Mapping[str, Path] = {}) -> Path | None:
    """As `find_package`, but only where something says that the folder is this package; else None."""
    if not PACKAGE_NAME.fullmatch(name):
        raise RobotError(f"{start}: {cut(name)} is no package name; a name has letters, digits, '_' and '-' only")
    if name in given:
        return _given_folder(name, given[name])
    shared = (prefix / "share" / name for prefix in _environment("AMENT_PREFIX_PATH"))
    found = next((folder for folder in shared if os.path.isdir(folder)), None)
    return found or _named(name, _environment("ROS_PACKAGE_PATH")) or _named(name, folders_above(start))


def nearest_robot_folder(start: Path) -> Path | None:
    """The nearest folder above `start` that has a `urdf` folder in it."""
    return next((folder for folder in folders_above(start) if os.path.isdir(folder / "urdf")), None)


def local_packages(start: Path) -> dict[str, Path]:
    """Name -> folder of every package whose package.xml is in the folders above `start` or their children."""
    return packages_in(folders_above(start))


def folders_above(start: Path) -> list[Path]:
    """The folders that hold `start`, nearest first, `start` itself too if it is a folder.

    The root and everything above a shared folder such as /tmp are left out: what other people put there must
    not pass for a package of this robot.
    """
    start = Path(os.path.abspath(start))
    folders = [start, *start.parents] if os.path.isdir(start) else list(start.parents)
    return list(takewhile(lambda folder: folder != folder.parent and not _is_shared(folder), folders))


def folders_below(start: Path) -> list[Path]:
    """The folders below a workspace, and below its src, that may hold packages or repositories of packages."""
    return [each for folder in (start / "src", start) for each in (folder, *_folders_in(folder)[:MOST])]


def _folders_in(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if entry.is_dir() and not entry.name.startswith(".")]
    except OSError:
        return []
    return [folder / name for name in sorted(names)]


def _given_folder(name: str, folder: Path) -> Path:
    if not os.path.isdir(folder):
        raise RobotError(f"--package {name}={folder}: there is no such folder; give the folder of package {cut(name)}")
    return folder


def _is_shared(folder: Path) -> bool:
    # The sticky bit marks /tmp: Windows drives under WSL are world-writable too, but not sticky.
    try:
        mode = folder.stat().st_mode
    except OSError:
        return False
    return bool(mode & stat.S_IWOTH and mode & stat.S_ISVTX)


def _environment(variable: str) -> list[Path]:
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]


def _named(name: str, folders: list[Path]) -> Path | None:
    return next((folder for found, folder in _packages(folders) if found == name), None)


def packages_in(folders: list[Path]) -> dict[str, Path]:
    """Name -> folder of every package whose package.xml is in these folders or their children; the first wins."""
    # Backwards, so that the nearest of two packages with one name wins.
    return dict(reversed(list(_packages(folders))))


def _packages(folders: list[Path]) -> Iterator[tuple[str, Path]]:
    for folder in folders:
        for candidate in (folder, *_children(folder)):
            name = _name_in_package_xml(candidate)
            if name:
                yield name, candidate


def _children(folder: Path) -> list[Path]:
    try:
        return sorted(child for child in folder.iterdir() if not child.name.startswith("."))
    except OSError:
        return []


def _name_in_package_xml(folder: Path) -> str | None:
    # A package.xml that cannot be read or parsed names nothing: it may belong to anybody.
    path = folder / "package.xml"
    try:
        state = os.stat(path)
        if not stat.S_ISREG(state.st_mode) or state.st_size > _LARGEST:
            return None
        name = ElementTree.parse(path).getroot().findtext("name", "")
    except (OSError, ElementTree.ParseError, ValueError):
        return None
    return name.strip() or None


def _unknown(name: str, start: Path, given: Mapping[str, Path]) -> str:
    searched = [*_environment("AMENT_PREFIX_PATH"), *_environment("ROS_PACKAGE_PATH"), *folders_above(start)]
    known = packages_in(_environment("ROS_PACKAGE_PATH")) | local_packages(start) | dict(given)
    return (
        f"{start}: there is no package {cut(name)}; packages found: {listed(list(known))};"
        f" looked in {', '.join(map(str, searched)) or 'no folder'}; say where it is: --package {name[:80]}=DIR"
        f"{near(name, list(known))}"
    )
