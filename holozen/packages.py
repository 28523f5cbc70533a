"""Find packages on this machine, with or without ROS."""

import os
import re
import stat
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import chain, islice, takewhile
from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.suggest import cut, listed, suggest

MODEL_PATHS = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH")
PACKAGE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
# of folders below one that are searched: from the root of a repository, src/ws/src/PACKAGE
LEVELS = 4
MAX_ON_LEVEL = 500  # folders searched on each level: a home folder has thousands
BUILT = ("build", "install", "log", "node_modules", "__pycache__")  # folders without sources
_LARGEST = 1_000_000  # bytes of a package.xml


def find_package(name: str, start: Path, given: Mapping[str, Path] = {}) -> Path:
    """The folder of package `name`, for a robot file (or folder) `start`.

    Search order: `given` (`--package NAME=DIR`); `<prefix>/share/<name>` of AMENT_PREFIX_PATH, then
    ROS_PACKAGE_PATH; a package.xml with that name in the folders above `start` and their children;
    last the nearest folder above `start` that has a `urdf` folder, since a repository may be cloned
    under any name.

    Raises RobotError naming the packages found and the folders searched.
    """
    found = find_named(name, start, given) or nearest_robot_folder(start)
    if found is None:
        raise RobotError(_unknown(name, start, given))
    return found


def find_named(name: str, start: Path, given: Mapping[str, Path] = {}) -> Path | None:
    """As `find_package`, without its last resort; None if no folder is known to be this package."""
    return find_declared(name, start, given) or _named(name, folders_above(start))


def find_declared(name: str, start: Path, given: Mapping[str, Path] = {}) -> Path | None:
    """The folder of a package that is `given` or that the environment names; None for any other.
    Raises RobotError.
    """
    if not PACKAGE_NAME.fullmatch(name):
        raise RobotError(
            f"{start}: {cut(name)} is not a package name; a name has letters, digits, '_' and '-' "
            "only"
        )
    if folder := given.get(name):
        if not os.path.isdir(folder):
            problem = f"--package {name}={folder}: there is no such folder"
            raise RobotError(f"{problem}; give the folder of package {cut(name)}")
        return folder
    shared = (prefix / "share" / name for prefix in folders_listed("AMENT_PREFIX_PATH"))
    found = next((folder for folder in shared if os.path.isdir(folder)), None)
    return found or _named(name, folders_listed("ROS_PACKAGE_PATH"))


def nearest_robot_folder(start: Path) -> Path | None:
    """The nearest folder above `start` that has a `urdf` folder in it."""
    return next((folder for folder in folders_above(start) if os.path.isdir(folder / "urdf")), None)


def local_packages(start: Path) -> dict[str, Path]:
    """Name -> folder of every package whose package.xml is in the folders above `start` or their
    children.
    """
    return packages_in(folders_above(start))


def known_folders(start: Path, given: Mapping[str, Path]) -> list[Path]:
    """The folders of the packages that a robot file `start` may use data from: those given, those
    named by the environment, and those around the file, except any that contains the user's home.
    """
    around = [
        *local_packages(start).values(),
        *([found] if (found := nearest_robot_folder(start)) else []),
    ]
    shared = [prefix / "share" for prefix in folders_listed("AMENT_PREFIX_PATH")]
    return [*given.values(), *shared, *folders_listed("ROS_PACKAGE_PATH"), *without_home(around)]


def without_home(folders: Iterable[Path]) -> list[Path]:
    """The folders except those that contain the user's home, which is not part of a robot."""
    home = os.path.realpath(os.path.expanduser("~"))
    return [folder for folder in folders if not holds(os.path.realpath(folder), home)]


def lies_in(path: str | Path, folders: Iterable[Path]) -> bool:
    """Whether a file is in one of the folders, symbolic links resolved, and not hidden there."""
    real = os.path.realpath(path)
    roots = (os.path.realpath(folder) for folder in folders)
    inside = (real[len(root) :].split(os.sep) for root in roots if holds(root, real))
    return any(not any(part.startswith(".") for part in parts) for parts in inside)


def holds(folder: str, path: str) -> bool:
    """Whether a path is a folder, or inside it; nothing counts as inside "/"."""
    return folder != os.sep and f"{path}{os.sep}".startswith(f"{folder}{os.sep}")


def folders_above(start: Path) -> list[Path]:
    """The folders that contain `start`, nearest first, `start` itself too if it is a folder.

    The root and everything above a shared folder such as /tmp are excluded: other users' files
    there must not be mistaken for a package of this robot.
    """
    start = Path(os.path.abspath(start))
    folders = [start, *start.parents] if os.path.isdir(start) else list(start.parents)
    return list(
        takewhile(lambda folder: folder != folder.parent and not _is_shared(folder), folders)
    )


def rings(starts: Iterable[Path]) -> Iterator[dict[str, list[Path]]]:
    """The packages around some files or folders, as name -> folders, nearest first; those of one
    ring are equally near.

    For each start come those below it, level by level, then the package that it belongs to, then
    those in its workspace. Only after all of them come those above the starts and beside those.
    """
    folders_of_starts = list(dict.fromkeys(map(folder_of, starts)))
    above = [folders_above(start) for start in folders_of_starts]
    for start, folders in zip(folders_of_starts, above, strict=True):
        yield from _below(start) if not _is_shared(start) else ()
        inside = takewhile(lambda folder: not _is_workspace(folder), folders)
        yield _by_name(
            folder for folder in islice((each for each in inside if _is_package(each)), 1)
        )
        for folder in filter(_is_workspace, folders):
            yield from _below(folder)
    for folder in chain.from_iterable(above):
        yield _by_name([folder])
        yield _by_name(_folders_in(folder))


def nearest(name: str, rings: Iterable[Mapping[str, list[Path]]]) -> Path | None:
    """The folder of a package in the first ring that has it; None if none has. Raises RobotError
    for two in one.
    """
    folders = next((ring[name] for ring in rings if name in ring), [])
    if len(folders) > 1:
        shown = ", ".join(map(str, folders[:4]))
        problem = f"several packages are called {cut(name)}, and none is nearer: {shown}"
        raise RobotError(f"{problem}; choose one by --package {name}=DIR, or start from its folder")
    return folders[0] if folders else None


def _below(start: Path) -> Iterator[dict[str, list[Path]]]:
    """The packages in a folder and below it, level by level. As for colcon, there are none below a
    package.
    """
    level = [start]
    for _ in range(LEVELS):
        yield _by_name(level)
        parents = [folder for folder in level if folder == start or not _is_package(folder)]
        level = [child for folder in parents for child in _source_folders(folder)][:MAX_ON_LEVEL]
    yield _by_name(level)


def _by_name(folders: Iterable[Path]) -> dict[str, list[Path]]:
    """The packages that these folders are. Of several links to one folder the first counts."""
    found: dict[str, dict[str, Path]] = {}
    for folder in folders:
        if name := _name_in_package_xml(folder):
            found.setdefault(name, {}).setdefault(os.path.realpath(folder), folder)
    return {name: [*same.values()] for name, same in found.items()}


def _is_package(folder: Path) -> bool:
    return os.path.isfile(folder / "package.xml")


def _is_workspace(folder: Path) -> bool:
    return os.path.isdir(folder / ".git") or (
        os.path.isdir(folder / "src") and not _is_package(folder)
    )


def _source_folders(folder: Path) -> list[Path]:
    """The folders in a folder that colcon would search."""
    if os.path.exists(folder / "COLCON_IGNORE"):
        return []
    return [child for child in _folders_in(folder) if child.name not in BUILT]


def _folders_in(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = [
                entry.name for entry in entries if entry.is_dir() and not entry.name.startswith(".")
            ]
    except OSError:
        return []
    return [folder / name for name in sorted(names)]


def _is_shared(folder: Path) -> bool:
    # The sticky bit marks /tmp: Windows drives under WSL are world-writable too, but not sticky.
    try:
        mode = folder.stat().st_mode
    except OSError:
        return False
    return bool(mode & stat.S_IWOTH and mode & stat.S_ISVTX)


def folders_listed(*variables: str, absolute: bool = False) -> list[Path]:
    """The folders that environment variables list."""
    parts = [
        part for variable in variables for part in os.environ.get(variable, "").split(os.pathsep)
    ]
    return [Path(part) for part in parts if part and (os.path.isabs(part) or not absolute)]


def _named(name: str, folders: list[Path]) -> Path | None:
    return next((folder for found, folder in _packages(folders) if found == name), None)


def packages_in(folders: list[Path]) -> dict[str, Path]:
    """Name -> folder of every package whose package.xml is in these folders or their children; the
    first wins.
    """
    # Backwards, so that the nearest of two packages with one name wins.
    return dict(reversed(list(_packages(folders))))


def _packages(folders: list[Path]) -> Iterator[tuple[str, Path]]:
    for folder in folders:
        for candidate in (folder, *_folders_in(folder)):
            name = _name_in_package_xml(candidate)
            if name:
                yield name, candidate


def _name_in_package_xml(folder: Path) -> str | None:
    # A package.xml that cannot be read or parsed has no name.
    path = folder / "package.xml"
    try:
        state = os.stat(path)
        if not stat.S_ISREG(state.st_mode) or state.st_size > _LARGEST:
            return None
        name = ElementTree.parse(path).getroot().findtext("name", "")
    except (OSError, ElementTree.ParseError, ValueError):
        return None
    return name.strip() or None


def is_for_ros2(start: Path) -> bool:
    """Whether the package around a file is built by ROS 2's ament."""
    for folder in folders_above(start):
        if os.path.isfile(folder / "package.xml"):
            try:
                return b"ament" in (folder / "package.xml").read_bytes()[:_LARGEST]
            except OSError:
                return False
    return False


def _unknown(name: str, start: Path, given: Mapping[str, Path]) -> str:
    searched = [
        *folders_listed("AMENT_PREFIX_PATH"),
        *folders_listed("ROS_PACKAGE_PATH"),
        *folders_above(start),
    ]
    known = packages_in(folders_listed("ROS_PACKAGE_PATH")) | local_packages(start) | dict(given)
    return (
        f"{start}: there is no package {cut(name)}; packages found: {listed(known)};"
        f" looked in {', '.join(map(str, searched)) or 'no folder'}; give its folder: --package "
        f"{name[:80]}=DIR"
        f"{suggest(name, list(known))}"
    )


def remember_folders() -> None:
    """From now on read each folder and package.xml once only, and remember it: for a process that
    is about to lose access to them.
    """
    global _folders_in, _name_in_package_xml
    _folders_in, _name_in_package_xml = cache(_folders_in), cache(_name_in_package_xml)


def folder_of(start: Path) -> Path:
    """The absolute folder of a file; of a folder, that one."""
    return Path(os.path.abspath(start if os.path.isdir(start) else start.parent))
