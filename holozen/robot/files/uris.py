"""The files that URIs in robot and world files refer to, and which of all files may be read for
them.
"""

import os
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import islice, takewhile
from pathlib import Path
from urllib.parse import unquote

from holozen import data
from holozen.packages import (
    MODEL_PATHS,
    PACKAGE_NAME,
    find_named,
    find_package,
    folder_of,
    folders_above,
    folders_listed,
    holds,
    known_folders,
    local_packages,
    nearest_robot_folder,
    without_home,
)
from holozen.robot.errors import RobotError
from holozen.suggest import cut


def readable(start: Path, given: Mapping[str, Path] = {}) -> list[str]:
    """The files and folders that a robot or world file `start` may use, itself included: those that
    the process reading it may open (see `reader.run`).
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


# searched for a missing mesh in one package; bounds the search if a home folder looks like one
MAX_FOLDERS = 5000
# environment variables used for the search
VARIABLES = ("HOME", "AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH", *MODEL_PATHS)
# one of these is in the folder of a model or a package
MARKS = ("model.config", "package.xml", "meshes")
NOWHERE = Path("/")  # the origin of text received over the network: no package is above it

_URI = re.compile(r"(?:([A-Za-z][A-Za-z0-9+.-]+)://)?(.*)", re.DOTALL)
_ABSOLUTE = re.compile(r"/|[A-Za-z]:[/\\]")  # also from Windows


def is_data(uri: str) -> bool:
    """Whether a URI contains the file itself."""
    return uri.lstrip()[:5].lower() == "data:"


def resolve_uri(
    uri: str,
    start: Path,
    given: Mapping[str, Path] = {},
    confined: bool = False,
    warn: Callable[[str], object] = repr,
) -> Path:
    """The existing file that `uri` names, as an absolute path.

    `uri` is `package://NAME/...`, `model://NAME/...`, `file:///...`, an absolute path, or a path
    relative to the folder of the robot file `start` or to its package; percent-encoded or not.
    Models and packages are also searched for in the folders of GAZEBO_MODEL_PATH and
    GZ_SIM_RESOURCE_PATH, and by folder name beside the folders above `start`. An absolute path that
    does not exist here comes from another machine: its file name is searched for in the given
    packages, in the robot's own and in those next to it, and the match that shares most trailing
    parts of the path is used; `warn` is called with a line about it.

    With `confined` only files in a known folder are found, symbolic links resolved: given packages,
    those named by ROS's and Gazebo's environment variables, and holozen's own. Nothing outside is
    even accessed.

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
            warn(
                instead_of(uri, matches, "used", portable_name(found, start, given, "package://{}"))
            )
    if found is None:
        looked = " and ".join(cut(str(place), 300)[1:-1] for place in places)
        raise RobotError(f"no such file {cut(uri, 200)}; looked for {looked}")
    return Path(os.path.abspath(found))


def _confined(uri: str, scheme: str, rest: str, given: Mapping[str, Path]) -> Path:
    if not scheme and not rest.startswith("/"):
        problem = (
            "is a relative path, which cannot be resolved here; send the mesh itself "
            "(holozen spawn does)"
        )
        raise RobotError(f"{cut(uri, 200)} {problem}")
    name = unquote(rest.partition("/")[0])
    if scheme and not named_folders(name, NOWHERE, given):
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
        f"{cut(uri, 200)} is not a file in a known package; send the mesh itself (holozen spawn "
        "does),"
        " or start the sim with --package NAME=DIR"
    )


def _known_folders(given: Mapping[str, Path]) -> list[Path]:
    """The folders in which untrusted text may refer to files."""
    shared = [prefix / "share" for prefix in folders_listed("AMENT_PREFIX_PATH", absolute=True)]
    own = [data.find(folder) for folder in ("meshes", "urdf", "worlds")]
    return [
        *given.values(),
        *shared,
        *folders_listed("ROS_PACKAGE_PATH", *MODEL_PATHS, absolute=True),
        *own,
    ]


def _split(uri: str) -> tuple[str, str]:
    """The scheme, empty for a file, and what follows it."""
    match = _URI.fullmatch(uri.strip())
    assert match is not None, "the pattern matches any text"
    scheme, rest = (match[1] or "").lower(), match[2]
    if scheme not in ("", "file", "package", "model"):
        raise RobotError(
            f"{cut(uri, 200)} is not fetched; write package://NAME/FILE, file:///FILE or a "
            "relative path"
        )
    return scheme.replace("file", ""), rest.removeprefix("localhost") if scheme == "file" else rest


def _places(scheme: str, rest: str, start: Path, given: Mapping[str, Path]) -> Iterator[Path]:
    # Literally first: a file name may really contain a %.
    for text in dict.fromkeys((rest, unquote(rest))):
        if scheme:
            name, _, inside = text.partition("/")
            # The last resort of `find_package` if no folder has that name.
            folders = named_folders(name, start, given) or [find_package(name, start, given)]
            yield from (folder / inside.lstrip("/") for folder in folders)
        else:  # joined to a folder, an absolute path is unchanged
            yield from (folder / text for folder in _own_folders(start))


def named_folders(name: str, start: Path, given: Mapping[str, Path]) -> list[Path]:
    """The folders of packages and models called `name`, nearest first."""
    named = find_named(name, start, given)
    models = [
        folder / name
        for folder in folders_listed(*MODEL_PATHS, absolute=True)
        if os.path.isdir(folder / name)
    ]
    beside = (folder / name for folder in folders_above(start))
    models += [folder for folder in beside if any(os.path.exists(folder / mark) for mark in MARKS)]
    return [*([named] if named else []), *models]


def _own_folders(start: Path) -> list[Path]:
    """The folder of the robot file, and that of the robot's package if different."""
    folder = folder_of(start)
    return list(dict.fromkeys((folder, nearest_robot_folder(start) or folder)))


def find_by_name(lost: str, start: Path, given: Mapping[str, Path]) -> list[Path]:
    """The files with the name of `lost`, a path on another machine, in the packages given, in those
    around the robot file `start`, and in its folder; sorted by how many trailing parts of the path
    they share, most first.
    """
    parts = re.split(r"[/\\]+", lost)
    roots = dict.fromkeys((*given.values(), *_own_folders(start), *local_packages(start).values()))
    matches = dict.fromkeys(
        Path(os.path.abspath(path)) for root in roots for path in _files_called(parts[-1], root)
    )
    return sorted(matches, key=lambda path: -_shared_end(path, parts))


def instead_of(lost: str, matches: list[Path], how: str, write: str) -> str:
    """A warning that the first of the files in `matches` is used instead of `lost` (`how`: "used"
    or "included"), what to `write` for it, and which others have the same name.
    """
    found, *others = matches
    more = [f"{len(others) - 3} more"] if len(others) > 3 else []
    also = f"; others of that name: {', '.join([*map(str, others[:3]), *more])}" if others else ""
    return (
        f"there is no file {cut(lost, 200)}; {found}, which has the same name, is {how}; write "
        f"{write}{also}"
    )


def portable_name(
    file: Path, start: Path, given: Mapping[str, Path], package: str = "$(find {})"
) -> str:
    """A portable replacement for a file's absolute path: `$(find NAME)/...`, or a path relative to
    `start`.

    `package` is the form of a reference to a package, with {} for its name.
    """
    packages = {
        name: os.path.abspath(folder)
        for name, folder in (local_packages(start) | dict(given)).items()
    }
    own = nearest_robot_folder(start)
    if own and str(own) not in packages.values():
        packages[own.name] = str(own)
    holding = [
        name
        for name, folder in packages.items()
        if holds(folder, str(file)) and PACKAGE_NAME.fullmatch(name)
    ]
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
