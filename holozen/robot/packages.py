"""Find packages, and the files that URIs refer to, on this machine, with or without ROS."""

import os
import re
import stat
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from itertools import islice, takewhile
from pathlib import Path
from urllib.parse import unquote

from holozen import data
from holozen.robot.errors import RobotError
from holozen.suggest import cut, listed, suggest

PACKAGE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
MAX_SEARCHED = 200  # folders below a workspace that are searched for packages
_LARGEST = 1_000_000  # bytes of a package.xml


def find_package(name: str, start: Path, given: Mapping[str, Path] = {}) -> Path:
    """The folder of package `name`, for a robot file (or folder) `start`.

    Search order: `given` (`--package NAME=DIR`); `<prefix>/share/<name>` of AMENT_PREFIX_PATH,
    then ROS_PACKAGE_PATH; a package.xml with that name in the folders above `start` and their children; last
    the nearest folder above `start` that has a `urdf` folder, since a repository may be cloned under any
    name.

    Raises RobotError naming the packages found and the folders searched.
    """
    found = find_named(name, start, given) or nearest_robot_folder(start)
    if found is None:
        raise RobotError(_unknown(name, start, given))
    return found


def find_named(name: str, start: Path, given: Mapping[str, Path] = {}) -> Path | None:
    """As `find_package`, without its last resort; None if no folder is known to be this package."""
    if not PACKAGE_NAME.fullmatch(name):
        raise RobotError(f"{start}: {cut(name)} is not a package name; a name has letters, digits, '_' and '-' only")
    if folder := given.get(name):
        if not os.path.isdir(folder):
            problem = f"--package {name}={folder}: there is no such folder"
            raise RobotError(f"{problem}; give the folder of package {cut(name)}")
        return folder
    shared = (prefix / "share" / name for prefix in folders_listed("AMENT_PREFIX_PATH"))
    found = next((folder for folder in shared if os.path.isdir(folder)), None)
    return found or _named(name, folders_listed("ROS_PACKAGE_PATH")) or _named(name, folders_above(start))


def nearest_robot_folder(start: Path) -> Path | None:
    """The nearest folder above `start` that has a `urdf` folder in it."""
    return next((folder for folder in folders_above(start) if os.path.isdir(folder / "urdf")), None)


def local_packages(start: Path) -> dict[str, Path]:
    """Name -> folder of every package whose package.xml is in the folders above `start` or their children."""
    return packages_in(folders_above(start))


def known_folders(start: Path, given: Mapping[str, Path]) -> list[Path]:
    """The folders of the packages that a robot file `start` may use data from: those given, those named by the
    environment, and those around the file, except any that contains the user's home.
    """
    around = [*local_packages(start).values(), *([found] if (found := nearest_robot_folder(start)) else [])]
    shared = [prefix / "share" for prefix in folders_listed("AMENT_PREFIX_PATH")]
    return [*given.values(), *shared, *folders_listed("ROS_PACKAGE_PATH"), *without_home(around)]


def without_home(folders: Iterable[Path]) -> list[Path]:
    """The folders except those that contain the user's home, which is not part of a robot."""
    home = os.path.realpath(os.path.expanduser("~"))
    return [folder for folder in folders if not _holds(os.path.realpath(folder), home)]


def lies_in(path: str | Path, folders: Iterable[Path]) -> bool:
    """Whether a file is in one of the folders, symbolic links resolved, and not hidden there."""
    real = os.path.realpath(path)
    roots = (os.path.realpath(folder) for folder in folders)
    inside = (real[len(root) :].split(os.sep) for root in roots if _holds(root, real))
    return any(not any(part.startswith(".") for part in parts) for parts in inside)


def _holds(folder: str, path: str) -> bool:
    # Nothing counts as inside "/".
    return folder != os.sep and f"{path}{os.sep}".startswith(f"{folder}{os.sep}")


def folders_above(start: Path) -> list[Path]:
    """The folders that contain `start`, nearest first, `start` itself too if it is a folder.

    The root and everything above a shared folder such as /tmp are excluded: other users' files there must
    not be mistaken for a package of this robot.
    """
    start = Path(os.path.abspath(start))
    folders = [start, *start.parents] if os.path.isdir(start) else list(start.parents)
    return list(takewhile(lambda folder: folder != folder.parent and not _is_shared(folder), folders))


def folders_below(start: Path) -> list[Path]:
    """The folders below a workspace, and below its src, that may contain packages or repositories of packages."""
    return [each for folder in (start / "src", start) for each in (folder, *_folders_in(folder)[:MAX_SEARCHED])]


def _folders_in(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if entry.is_dir() and not entry.name.startswith(".")]
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
    parts = [part for variable in variables for part in os.environ.get(variable, "").split(os.pathsep)]
    return [Path(part) for part in parts if part and (os.path.isabs(part) or not absolute)]


def _named(name: str, folders: list[Path]) -> Path | None:
    return next((folder for found, folder in _packages(folders) if found == name), None)


def packages_in(folders: list[Path]) -> dict[str, Path]:
    """Name -> folder of every package whose package.xml is in these folders or their children; the first wins."""
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


def _unknown(name: str, start: Path, given: Mapping[str, Path]) -> str:
    searched = [*folders_listed("AMENT_PREFIX_PATH"), *folders_listed("ROS_PACKAGE_PATH"), *folders_above(start)]
    known = packages_in(folders_listed("ROS_PACKAGE_PATH")) | local_packages(start) | dict(given)
    return (
        f"{start}: there is no package {cut(name)}; packages found: {listed(known)};"
        f" looked in {', '.join(map(str, searched)) or 'no folder'}; give its folder: --package {name[:80]}=DIR"
        f"{suggest(name, list(known))}"
    )


def remember_folders() -> None:
    """From now on read each folder and package.xml once only, and remember it: for a process that is about to lose
    access to them.
    """
    global _folders_in, _name_in_package_xml
    _folders_in, _name_in_package_xml = cache(_folders_in), cache(_name_in_package_xml)


def readable(start: Path, given: Mapping[str, Path] = {}) -> list[str]:
    """The files and folders that a robot or world file `start` may use, itself included: those that the process reading
    it may open (see `reader.run`).
    """
    around = [start.absolute().parent, *(folder / "models" for folder in folders_above(start))]
    folders = [*known_folders(start, given), *without_home(around), *_known_folders(given)]
    models = Path.home() / ".gazebo" / "models"
    names = [folder / "package.xml" for folder in local_packages(start).values()]
    return [*dict.fromkeys(map(os.path.abspath, (start, *folders, models, *names)))]


def readable_by_strangers(given: Mapping[str, Path] = {}) -> list[str]:
    """The folders in which text that came over the network may refer to files."""
    return [*map(os.path.abspath, _known_folders(given))]


# Mesh URIs -> files.


MAX_FOLDERS = 5000  # searched for a missing mesh in one package; bounds the search if a home folder looks like one
MODEL_PATHS = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH")
VARIABLES = ("HOME", "AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH", *MODEL_PATHS)  # environment variables used for the search
MARKS = ("model.config", "package.xml", "meshes")  # one of these is in the folder of a model or a package
NOWHERE = Path("/")  # the origin of text received over the network: no package is above it

_URI = re.compile(r"(?:([A-Za-z][A-Za-z0-9+.-]+)://)?(.*)", re.DOTALL)
_ABSOLUTE = re.compile(r"/|[A-Za-z]:[/\\]")  # also from Windows


def is_data(uri: str) -> bool:
    """Whether a URI contains the file itself."""
    return uri.lstrip()[:5].lower() == "data:"


def resolve_uri(
    uri: str, start: Path, given: Mapping[str, Path] = {}, confined: bool = False, warn: Callable[[str], object] = repr
) -> Path:
    """The existing file that `uri` names, as an absolute path.

    `uri` is `package://NAME/...`, `model://NAME/...`, `file:///...`, an absolute path, or a path relative to
    the folder of the robot file `start` or to its package; percent-encoded or not. Models and packages are also
    searched for in the folders of GAZEBO_MODEL_PATH and GZ_SIM_RESOURCE_PATH, and by folder name beside the folders
    above `start`. An absolute path that does not exist here comes from another machine: its file name is searched for
    in the given packages, in the robot's own and in those next to it, and the match that shares most trailing parts of
    the path is used; `warn` is called with a line about it.

    With `confined` only files in a known folder are found, symbolic links resolved: given packages, those named by
    ROS's and Gazebo's environment variables, and holozen's own. Nothing outside is even accessed.

    Raises RobotError naming the folders searched.
    """
    scheme, rest = _split(uri)
    if confined:
        return _confined(uri, scheme, rest, given)
    places = list(dict.fromkeys(_places(scheme, rest, start, given)))
    found = next((place for place in places if os.path.isfile(place)), None)
    if found is None and not scheme and _ABSOLUTE.match(rest):
        matches = find_by_name(unquote(rest), start, given)
        if matches:
            found = matches[0]
            warn(instead_of(uri, matches, "used", portable_name(found, start, given, "package://{}")))
    if found is None:
        looked = " and ".join(cut(str(place), 300)[1:-1] for place in places)
        raise RobotError(f"no such file {cut(uri, 200)}; looked for {looked}")
    return Path(os.path.abspath(found))


def _confined(uri: str, scheme: str, rest: str, given: Mapping[str, Path]) -> Path:
    if not scheme and not rest.startswith("/"):
        problem = "is a relative path, which cannot be resolved here; send the mesh itself (holozen spawn does)"
        raise RobotError(f"{cut(uri, 200)} {problem}")
    name = unquote(rest.partition("/")[0])
    if scheme and not _named_folders(name, NOWHERE, given):
        raise RobotError(
            f"{cut(uri, 200)}: the sim does not know the package {cut(name)}; start it with"
            f" --package {name[:80]}=DIR, or use `holozen spawn FILE`, which sends meshes along"
        )
    roots = [os.path.realpath(folder) for folder in _known_folders(given)]
    for place in _places(scheme, rest, NOWHERE, given):
        real = "" if "\0" in str(place) else os.path.realpath(place)
        # A root of "/" matches nothing: no path starts with "//".
        if any(real.startswith(root + os.sep) for root in roots) and os.path.isfile(real):
            return Path(real)
    raise RobotError(
        f"{cut(uri, 200)} is not a file in a known package; send the mesh itself (holozen spawn does),"
        " or start the sim with --package NAME=DIR"
    )


def _known_folders(given: Mapping[str, Path]) -> list[Path]:
    """The folders in which untrusted text may refer to files."""
    shared = [prefix / "share" for prefix in folders_listed("AMENT_PREFIX_PATH", absolute=True)]
    own = [data.find(folder) for folder in ("meshes", "urdf", "worlds")]
    return [*given.values(), *shared, *folders_listed("ROS_PACKAGE_PATH", *MODEL_PATHS, absolute=True), *own]


def _split(uri: str) -> tuple[str, str]:
    """The scheme, empty for a file, and what follows it."""
    match = _URI.fullmatch(uri.strip())
    assert match is not None, "the pattern matches any text"
    scheme, rest = (match[1] or "").lower(), match[2]
    if scheme not in ("", "file", "package", "model"):
        raise RobotError(f"{cut(uri, 200)} is not fetched; write package://NAME/FILE, file:///FILE or a relative path")
    return scheme.replace("file", ""), rest.removeprefix("localhost") if scheme == "file" else rest


def _places(scheme: str, rest: str, start: Path, given: Mapping[str, Path]) -> Iterator[Path]:
    # Literally first: a file name may really contain a %.
    for text in dict.fromkeys((rest, unquote(rest))):
        if scheme:
            name, _, inside = text.partition("/")
            # The last resort of `find_package` if no folder has that name.
            folders = _named_folders(name, start, given) or [find_package(name, start, given)]
            yield from (folder / inside.lstrip("/") for folder in folders)
        else:  # joined to a folder, an absolute path is unchanged
            yield from (folder / text for folder in _own_folders(start))


def _named_folders(name: str, start: Path, given: Mapping[str, Path]) -> list[Path]:
    named = find_named(name, start, given)
    models = [folder / name for folder in folders_listed(*MODEL_PATHS, absolute=True) if os.path.isdir(folder / name)]
    beside = (folder / name for folder in folders_above(start))
    models += [folder for folder in beside if any(os.path.exists(folder / mark) for mark in MARKS)]
    return [*([named] if named else []), *models]


def _own_folders(start: Path) -> list[Path]:
    """The folder of the robot file, and that of the robot's package if different."""
    folder = folder_of(start)
    return list(dict.fromkeys((folder, nearest_robot_folder(start) or folder)))


def folder_of(start: Path) -> Path:
    """The absolute folder of a file; of a folder, that one."""
    return Path(os.path.abspath(start if os.path.isdir(start) else start.parent))


def find_by_name(lost: str, start: Path, given: Mapping[str, Path]) -> list[Path]:
    """The files with the name of `lost`, a path on another machine, in the packages given, in those around the robot
    file `start`, and in its folder; sorted by how many trailing parts of the path they share, most first.
    """
    parts = re.split(r"[/\\]+", lost)
    roots = dict.fromkeys((*given.values(), *_own_folders(start), *local_packages(start).values()))
    matches = dict.fromkeys(Path(os.path.abspath(path)) for root in roots for path in _files_called(parts[-1], root))
    return sorted(matches, key=lambda path: -_shared_end(path, parts))


def instead_of(lost: str, matches: list[Path], how: str, write: str) -> str:
    """A warning that the first of the files in `matches` is used instead of `lost` (`how`: "used" or "included"), what
    to `write` for it, and which others have the same name.
    """
    found, *others = matches
    more = [f"{len(others) - 3} more"] if len(others) > 3 else []
    also = f"; others of that name: {', '.join([*map(str, others[:3]), *more])}" if others else ""
    return f"there is no file {cut(lost, 200)}; {found}, which has the same name, is {how}; write {write}{also}"


def portable_name(file: Path, start: Path, given: Mapping[str, Path], package: str = "$(find {})") -> str:
    """A portable replacement for a file's absolute path: `$(find NAME)/...`, or a path relative to `start`.

    `package` is the form of a reference to a package, with {} for its name.
    """
    packages = {name: os.path.abspath(folder) for name, folder in (local_packages(start) | dict(given)).items()}
    own = nearest_robot_folder(start)
    if own and str(own) not in packages.values():
        packages[own.name] = str(own)
    holding = [name for name, folder in packages.items() if _holds(folder, str(file)) and PACKAGE_NAME.fullmatch(name)]
    if not holding:
        return os.path.relpath(file, os.path.dirname(os.path.abspath(start)))
    name = max(holding, key=lambda name: len(packages[name]))
    return f"{package.format(name)}/{os.path.relpath(file, packages[name])}"


def _files_called(name: str, root: Path) -> Iterator[Path]:
    for folder, children, files in islice(os.walk(root), MAX_FOLDERS):
        children[:] = sorted(child for child in children if not child.startswith("."))
        if name in files:
            yield Path(folder, name)


def _shared_end(path: Path, parts: list[str]) -> int:
    pairs = zip(reversed(path.parts), reversed(parts), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
