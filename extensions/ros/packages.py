"""What this process may use: the packages of `--package`, those around the script and the working
folder, and the environment variables of `--allow-env`.

`holozen run` and `holozen launch` set them once, before any of the user's code runs.
"""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path

from holozen.packages import find_declared, find_named, nearest, nearest_robot_folder, rings
from holozen.robot.errors import RobotError
from holozen.suggest import listed, suggest

given: dict[str, Path] = {}
allow_env: list[str] = []
starts: list[Path] = []
stand_ins: dict[str, Path] = {}
"""Packages of ROS that `holozen launch` replaces, with folders that do not exist."""
absent: list[str] = []
"""Patterns of the names of ROS's packages whose nodes `holozen launch` leaves out."""
NOWHERE = Path("/holozen-stands-in-for")  # the folder of packages that exist by name only


def use(packages: Mapping[str, Path], *places: Path, env: Sequence[str] = ()) -> None:
    """Set the packages of `--package`, the folders around which others are searched, besides the
    working folder, and the environment variables that robot files may read.
    """
    given.clear()
    given.update(packages)
    allow_env[:] = env
    starts[:] = [*places, Path.cwd()]


def find(name: str, nameless: bool = True) -> Path:
    """The folder of a package: where its `package.xml` is, or `<prefix>/share/<name>`. Raises
    RobotError, also for two that are equally near.

    Otherwise, if `nameless` and no package has a similar name: the nearest folder with a robot but
    no package.xml.
    """
    found = (
        find_declared(name, starts[-1], given)
        or stand_ins.get(name)
        or nearest(name, rings(starts))
    )
    if found:
        return found
    if any(fnmatch(name, pattern) for pattern in absent):
        return NOWHERE / name
    known = [*around(), *stand_ins]
    similar = suggest(name, known)
    # a repository may be cloned under any name
    for start in starts if nameless and not similar else []:
        folder = nearest_robot_folder(start)
        if folder and not (folder / "package.xml").exists():
            return folder
    hint = similar or f"; packages found: {listed(known)}"
    searched = ", ".join(dict.fromkeys(map(str, starts)))
    raise RobotError(
        f"no package {name!r} around {searched}{hint}; to give its folder: --package "
        f"{name[:80]}=DIR"
    )


def is_missing(name: str) -> bool:
    """Whether no package has that name."""
    try:
        return not (find_declared(name, starts[-1], given) or nearest(name, rings(starts)))
    except RobotError:
        return False


def around() -> dict[str, Path]:
    """Name -> folder of the given packages and of those around the folders of `use`; the nearest
    wins.
    """
    found = dict(given)
    for ring in rings(starts):
        for name, folders in ring.items():
            found.setdefault(name, folders[0])
    return found


def known_to(file: Path) -> dict[str, Path]:
    """Name -> folder of the packages that a robot file may name: the given ones, and of those
    around the folders of `use` the ones that are not found from the file itself.
    """
    others = {
        name: folder for name, folder in around().items() if find_named(name, file, given) is None
    }
    return {**others, **given}


def prefix(folder: Path) -> Path:
    """Where a package is installed: the folder above `share`, or its own folder if it is not
    installed.
    """
    return folder.parents[1] if folder.parent.name == "share" else folder
