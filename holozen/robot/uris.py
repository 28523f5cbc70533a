"""From what a robot file calls a mesh to the file on this machine."""

import os
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import islice, takewhile
from pathlib import Path
from urllib.parse import unquote

from holozen import data
from holozen.robot.errors import RobotError, cut
from holozen.robot.packages import find_named, find_package, folders_above, local_packages, nearest_robot_folder

MOST_FOLDERS = 5000  # searched for a lost mesh in one package; keeps it short where a home folder passes for one
MODEL_PATHS = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH")
NOWHERE = Path("/")  # where a text that came over the wire stands: no package is above it

_URI = re.compile(r"(?:([A-Za-z][A-Za-z0-9+.-]+)://)?(.*)", re.DOTALL)
_ABSOLUTE = re.compile(r"/|[A-Za-z]:[/\\]")  # also of a Windows machine


def is_data(uri: str) -> bool:
    """Whether a URI holds the file itself, and names none."""
    return uri.lstrip()[:5].lower() == "data:"


def resolve_uri(
    uri: str, start: Path, given: Mapping[str, Path] = {}, confined: bool = False, tell: Callable[[str], object] = repr
) -> Path:
    """The existing file that `uri` names, as an absolute path.

    `uri` is `package://NAME/...`, `model://NAME/...`, `file:///...`, an absolute path, or a path relative to
    the folder of the robot file `start` or to its package; percent-encoded or not. Models and packages are looked for
    in the folders of GAZEBO_MODEL_PATH and GZ_SIM_RESOURCE_PATH, and by their folder's name beside the folders above
    `start`, too. An absolute path that does not exist here comes from another machine: its file name is searched in the
    given packages, in the robot's own and in the ones next to it, and the match that shares most of the path's end is
    taken; `tell` is called with a line about it.

    With `confined` only files that really lie in a known folder are found, symbolic links followed: given packages,
    those that ROS's and Gazebo's environment variables name, and holozen's own. Nothing outside is even looked at.

    Raises RobotError that says where it looked.
    """
    scheme, rest = _split(uri)
    if confined:
        return _confined(uri, scheme, rest, given)
    places = list(dict.fromkeys(_places(scheme, rest, start, given)))
    found = next((place for place in places if os.path.isfile(place)), None)
    if found is None and not scheme and _ABSOLUTE.match(rest):
        found = _by_file_name(unquote(rest), start, given)
        if found is not None:
            tell(f"there is no file {cut(uri, 200)}; {found} is taken, which has its name")
    if found is None:
        looked = " and ".join(cut(str(place), 300)[1:-1] for place in places)
        raise RobotError(f"no such file {cut(uri, 200)}; looked for {looked}")
    return Path(os.path.abspath(found))


def _confined(uri: str, scheme: str, rest: str, given: Mapping[str, Path]) -> Path:
    if not scheme and not rest.startswith("/"):
        told = "is a path that means nothing here; send the mesh itself (holozen spawn does)"
        raise RobotError(f"{cut(uri, 200)} {told}")
    name = unquote(rest.partition("/")[0])
    if scheme and not _named_folders(name, NOWHERE, given):
        raise RobotError(
            f"{cut(uri, 200)}: the sim does not know the package {cut(name)}; start it with"
            f" --package {name[:80]}=DIR, or use `holozen spawn FILE`, which sends meshes along"
        )
    roots = [os.path.realpath(folder) for folder in _known_folders(given)]
    for place in _places(scheme, rest, NOWHERE, given):
        real = "" if "\0" in str(place) else os.path.realpath(place)
        # A root of "/" takes nothing in: no path starts with "//".
        if any(real.startswith(root + os.sep) for root in roots) and os.path.isfile(real):
            return Path(real)
    raise RobotError(
        f"{cut(uri, 200)} is no file in a known package; send the mesh itself (holozen spawn does),"
        " or start the sim with --package NAME=DIR"
    )


def _known_folders(given: Mapping[str, Path]) -> list[Path]:
    """The folders that a text from anywhere may name files in."""
    shared = [prefix / "share" for prefix in _environment("AMENT_PREFIX_PATH")]
    own = [data.find(folder) for folder in ("meshes", "urdf", "worlds")]
    return [*given.values(), *shared, *_environment("ROS_PACKAGE_PATH", *MODEL_PATHS), *own]


def _environment(*variables: str) -> list[Path]:
    texts = [os.environ.get(variable, "") for variable in variables]
    return [Path(part) for text in texts for part in text.split(os.pathsep) if os.path.isabs(part)]


def _split(uri: str) -> tuple[str, str]:
    """The scheme, empty for a file, and what follows it."""
    match = _URI.fullmatch(uri.strip())
    assert match is not None, "the pattern takes any text"
    scheme, rest = (match[1] or "").lower(), match[2]
    if scheme not in ("", "file", "package", "model"):
        raise RobotError(f"{cut(uri, 200)} is not fetched; write package://NAME/FILE, file:///FILE or a relative path")
    return scheme.replace("file", ""), rest.removeprefix("localhost") if scheme == "file" else rest


def _places(scheme: str, rest: str, start: Path, given: Mapping[str, Path]) -> Iterator[Path]:
    # The text as it stands first: a file's name may really have a % in it.
    for text in dict.fromkeys((rest, unquote(rest))):
        if scheme:
            name, _, inside = text.partition("/")
            yield from (folder / inside.lstrip("/") for folder in _folders(name, start, given))
        else:  # joined to a folder, an absolute path stays what it is
            yield from (folder / text for folder in _own_folders(start))


def _folders(name: str, start: Path, given: Mapping[str, Path]) -> list[Path]:
    """Those of the package or model; the last resort of `find_package` if nothing is called so."""
    return _named_folders(name, start, given) or [find_package(name, start, given)]


def _named_folders(name: str, start: Path, given: Mapping[str, Path]) -> list[Path]:
    named = find_named(name, start, given)
    models = [folder / name for folder in _environment(*MODEL_PATHS) if os.path.isdir(folder / name)]
    models += [folder / name for folder in folders_above(start) if _is_model(folder / name)]
    return [*([named] if named else []), *models]


def _is_model(folder: Path) -> bool:
    """Whether something in a folder says that it is a model's or a package's."""
    return any(os.path.exists(folder / name) for name in ("model.config", "package.xml", "meshes"))


def _own_folders(start: Path) -> list[Path]:
    """The folder of the robot file, and the robot's package if that is another."""
    folder = Path(os.path.abspath(start if os.path.isdir(start) else start.parent))
    return list(dict.fromkeys((folder, nearest_robot_folder(start) or folder)))


def _by_file_name(lost: str, start: Path, given: Mapping[str, Path]) -> Path | None:
    parts = re.split(r"[/\\]+", lost)
    roots = dict.fromkeys((*given.values(), *_own_folders(start), *local_packages(start).values()))
    matches = [path for root in roots for path in _files_called(parts[-1], root)]
    return max(matches, key=lambda path: _shared_end(path, parts), default=None)


def _files_called(name: str, root: Path) -> Iterator[Path]:
    for folder, children, files in islice(os.walk(root), MOST_FOLDERS):
        children[:] = sorted(child for child in children if not child.startswith("."))
        if name in files:
            yield Path(folder, name)


def _shared_end(path: Path, parts: list[str]) -> int:
    pairs = zip(reversed(path.parts), reversed(parts), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
