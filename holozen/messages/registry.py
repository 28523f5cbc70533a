"""Looks up types by name, in the tables of interfaces/ and in the msg, srv and action folders of
packages.
"""

import contextlib
import functools
import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from holozen.messages.definitions import (
    ACTION_PARTS,
    LARGEST_FILE,
    PRIMITIVES,
    Interface,
    InterfaceError,
    action_parts,
    parse,
    split_text,
)
from holozen.suggest import last_part, listed, suggest

if TYPE_CHECKING:
    from pathlib import Path

TABLES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "interfaces")
KINDS = ("msg", "srv", "action")
_SECTIONS = {"msg": 1, "srv": 2, "action": 3}  # of a file
_NAME = re.compile(r"([A-Za-z][A-Za-z0-9_]*)/(?:(msg|srv|action)/)?([A-Za-z][A-Za-z0-9_]*)")
DEEPEST = 50  # levels of nesting
MAX_LOST = 100  # unknown names that are remembered, so that they are not looked up again
MAX_SHOWN = 20  # names in an error
OTHER_WORDS = {
    "float": "float32 or float64",
    "double": "float64",
    "int": "int32 or int64",
    "boolean": "bool",
}
"""Types of other languages -> the ones to write."""
_HALVES = ("_Request", "_Response")
# ends of names within an action
_PARTS = tuple(f"_{part}{half}" for part in ACTION_PARTS for half in ("", *_HALVES))

Folders = Mapping[str, "str | os.PathLike[str]"]
Paths = Sequence["str | os.PathLike[str]"]


class Source(NamedTuple):
    """The text of a definition, its file, and its first line; `strict` if its names have to be
    those of ROS 2.
    """

    text: str
    where: str
    line: int = 1
    strict: bool = False


def table(package: str) -> dict[str, Source]:
    """The definitions of a package that comes with holozen, by `msg/Name`; empty for any other."""
    structs = {
        name: source
        for name, source in _sections("structs").items()
        if name.startswith(f"{package}/")
    }
    return {name.partition("/")[2]: source for name, source in structs.items()} | _sections(package)


def tables() -> list[str]:
    """The packages that come with holozen."""
    files = {name.removesuffix(".txt") for name in os.listdir(TABLES) if name.endswith(".txt")}
    return sorted({name.partition("/")[0] for name in _sections("structs")} | files - {"structs"})


@functools.cache
def _sections(name: str) -> dict[str, Source]:
    """The definitions in a file of interfaces/, by their headings; empty if there is no such
    file.
    """
    path = os.path.join(TABLES, f"{name}.txt")
    if not os.path.isfile(path):
        return {}
    with open(path, encoding="utf-8") as file:
        text = file.read()
    found = list(re.finditer(r"^\[([\w/]+)\]\n", text, re.MULTILINE))
    ends = [*(heading.start() for heading in found[1:]), len(text)]
    return {
        heading[1]: Source(text[heading.end() : end], path, text.count("\n", 0, heading.end()) + 1)
        for heading, end in zip(found, ends, strict=True)
    }


class Places:
    """Finds the definitions of packages.

    `given` are the folders of some of them. The others are looked up once, around the files or
    folders `near` and around the working folder.
    """

    def __init__(self, given: Folders, near: Paths = ()) -> None:
        self._given = {name: os.fspath(folder) for name, folder in given.items()}
        self._near = near
        self._found: dict[str, str | None] = {}
        self.learned: dict[str, Source] = {}  # by full names; what is here comes first

    def source(self, package: str, name: str) -> Source | None:
        """The definition of `name` (such as `msg/Twist`) in a package; None if there is none.
        Raises InterfaceError.
        """
        if package not in self._given and (ours := table(package)):
            return ours.get(name)
        path = self.folder(package)
        kind, _, last = name.partition("/")
        found = None if path is None else _read(os.path.join(path, kind, f"{last}.{kind}"))
        return found or self.learned.get(f"{package}/{name}")

    def names(self, package: str) -> list[str]:
        """The definitions of a package, such as `msg/Twist`. Raises InterfaceError."""
        if package not in self._given and (ours := table(package)):
            return sorted(ours)
        path = self.folder(package)
        found = sorted(_names_in(path)) if path else []
        if package in self._given and not found:
            raise InterfaceError(
                f"--package {package}={path}: no .msg, .srv or .action files in its folders msg, "
                "srv and action"
            )
        return found

    def packages(self) -> list[str]:
        """Our own, the given ones, and those of the environment's folders and around that hold
        definitions.
        """
        shared = [os.path.join(prefix, "share") for prefix in _environment("AMENT_PREFIX_PATH")]
        for place in (*shared, *_environment("ROS_PACKAGE_PATH")):
            for name in _listing(place):
                path = os.path.join(place, name)
                if re.fullmatch(r"\w+", name) and any(_names_in(path)):
                    self._found.setdefault(name, path)
        for name, folders in (item for ring in self._rings for item in ring.items()):
            if any(_names_in(path := str(folders[0]))):
                self._found.setdefault(name, path)
        return sorted(
            {*tables(), *self._given, *(name for name, path in self._found.items() if path)}
        )

    def folder(self, package: str) -> str | None:
        """The folder of a package that is not ours; None if it is not found. Raises
        InterfaceError.
        """
        if package not in self._given:
            if package not in self._found:
                self._found[package] = self._look_up(package)
            return self._found[package]
        path = self._given[package]
        if not os.path.isdir(path):
            raise InterfaceError(f"--package {package}={path}: there is no such folder")
        return path

    def _look_up(self, package: str) -> str | None:
        """The folder of a package that is not ours, found as those of scripts are. Raises
        InterfaceError.
        """
        from pathlib import Path

        from holozen.packages import find_declared, nearest
        from holozen.robot.errors import RobotError

        try:
            found = find_declared(package, Path()) or nearest(package, self._rings)
        except RobotError as error:
            raise InterfaceError(str(error)) from None
        return str(found) if found else None

    @functools.cached_property
    def _rings(self) -> "list[dict[str, list[Path]]]":
        """The packages around the files or folders `near` and the working folder."""
        from pathlib import Path

        from holozen.packages import rings

        starts = [*map(Path, self._near)]
        with contextlib.suppress(OSError):  # the working folder is gone
            starts.append(Path.cwd())
        return list(rings(starts))


def _environment(variable: str) -> list[str]:
    return [part for part in os.environ.get(variable, "").split(os.pathsep) if part]


def _names_in(path: str) -> Iterator[str]:
    for kind in KINDS:
        for name in _listing(os.path.join(path, kind)):
            if re.fullmatch(rf"\w+\.{kind}", name):
                yield f"{kind}/{name.removesuffix('.' + kind)}"


def _listing(path: str) -> list[str]:
    try:
        return os.listdir(path)
    except OSError:
        return []


def _read(path: str) -> Source | None:
    try:
        state = os.stat(path)
        if not stat.S_ISREG(state.st_mode):
            raise InterfaceError(f"{path} is not a file")
        with open(path, encoding="utf-8-sig") as file:
            return Source(file.read(LARGEST_FILE + 1), path, strict=True)
    except FileNotFoundError:
        return None
    except UnicodeDecodeError:
        raise InterfaceError(f"{path}: the text is not UTF-8") from None
    except OSError as error:
        raise InterfaceError(f"cannot read {path}: {error.strerror}") from None


class Registry:
    """Finds types, each parsed once.

    A package is looked up among `packages` (name -> folder, as `--package NAME=DIR` gives), in our
    own tables, then in AMENT_PREFIX_PATH, ROS_PACKAGE_PATH, around the files or folders `near` and
    around the working folder.
    """

    def __init__(self, packages: Folders = {}, near: Paths = ()) -> None:
        self.places = Places(packages, near)
        self._found: dict[str, Interface] = {}
        self._lost: dict[str, InterfaceError] = {}  # any sample may name one
        self._asked: set[str] = set()  # types whose definition was asked for
        self._open: list[str] = []  # types being parsed, to detect one that contains itself

    def find(self, name: str) -> Interface:
        """The type called `name`: `geometry_msgs/msg/Twist`, `std_srvs/srv/Trigger`, or a service's
        half `std_srvs/srv/Trigger_Request`. Raises InterfaceError, with the closest name there is.
        """
        if name in self._found:
            return self._found[name]
        if name in self._lost:
            raise self._lost[name].with_traceback(None)
        try:
            found = self._found[name] = self._find(name)
        except InterfaceError as error:
            if not self._open and len(self._lost) < MAX_LOST:
                self._lost[name] = error
            raise
        return found

    def learn(self, name: str, define: Callable[[str], str]) -> Interface:
        """As `find`; for a type that is not known, `define` is called once, which returns its
        `whole_text` or an empty text. Raises InterfaceError.
        """
        try:
            return self.find(name)
        except InterfaceError:
            if name in self._asked or len(self._asked) == MAX_LOST or not (text := define(name)):
                raise
        self._asked.add(name)
        learned = split_text(name, text)
        self.places.learned |= {
            full: Source(part, f"the definition of {full}") for full, part in learned.items()
        }
        for full in learned:
            self._lost.pop(full, None)
        return self.find(name)

    def names(self) -> list[str]:
        """All types that can be listed, sorted."""
        known = self.places.packages()
        return [f"{package}/{name}" for package in known for name in self.places.names(package)]

    def _find(self, name: str) -> Interface:
        if re.fullmatch(r"\w+", name):
            raise InterfaceError(self._bare(name))
        package, kind, last = _parts(name)
        for each in (kind,) if kind else KINDS:
            if found := self._get(package, f"{each}/{last}"):
                return found
        raise InterfaceError(self._unknown(name, package))

    def _get(self, package: str, name: str) -> Interface | None:
        full = f"{package}/{name}"
        if full not in self._found:
            whole = _file(name)
            source = self.places.source(package, whole)
            if source is None and whole != name:  # a part of an action that a node has defined
                whole, source = name, self.places.learned.get(full)
            if source is None:
                return None
            self._keep(package, whole, source)
        return self._found.get(full)

    def _keep(self, package: str, name: str, source: Source) -> None:
        full, kind = f"{package}/{name}", name.partition("/")[0]
        if kind != "msg" and _file(name) != name:
            kind = "msg"
        if full in self._open:
            raise InterfaceError(f"{full} contains itself: {' > '.join([*self._open, full])}")
        if len(self._open) == DEEPEST:
            raise InterfaceError(f"{self._open[0]} is nested more than {DEEPEST} deep")
        self._open.append(full)
        try:
            if source.strict:
                _check_file(source.where, name.rpartition("/")[2])
            resolve = functools.partial(self._nested, package, source.strict)
            sections = parse(source.text, source.where, resolve, source.line, source.strict)
            wanted = _SECTIONS[kind]
            if len(sections) != wanted:
                parts = "1 part" if len(sections) == 1 else f"{len(sections)} parts"
                raise InterfaceError(f"{source.where}: '---' makes {parts}; a .{kind} has {wanted}")
            if kind == "action":
                made = action_parts(full, sections, self.find)
            else:
                ends = _HALVES if kind == "srv" else ("",)
                made = [
                    Interface(full + end, "msg", *section)
                    for end, section in zip(ends, sections, strict=True)
                ]
        finally:
            self._open.pop()
        if kind != "msg":
            made.append(Interface(full, kind, parts=tuple(made)))
        made += [
            half
            for service in made
            if kind == "action" and service.kind == "srv"
            for half in service.parts
        ]
        self._found.update({interface.name: interface for interface in made})

    def _nested(self, package: str, strict: bool, name: str) -> Interface:
        """The message that a file of `package` calls `name`."""
        if "/" in name:
            home, kind, last = _parts(name)
            if strict and kind == "msg":
                raise InterfaceError(
                    f"{name!r} has a 'msg' that ROS 2 refuses in a file; write {home}/{last}"
                )
            if kind == "srv" or (kind == "action" and _file(f"action/{last}") == f"action/{last}"):
                what = "a service" if kind == "srv" else "an action"
                raise InterfaceError(f"{name}: a field is a message, not {what}")
            return self.find(f"{home}/{kind or 'msg'}/{last}")
        if name == "Header" and not self.places.source(package, "msg/Header"):
            package = "std_msgs"  # as ROS 1 wrote it
        return self.find(f"{package}/msg/{name}")

    def _bare(self, name: str) -> str:
        same = [full for full in self.names() if full.rpartition("/")[2].lower() == name.lower()]
        if same:
            return f"{name[:80]!r} has no package; write {' or '.join(same)}"
        return f"{name[:80]!r} is not a type; `holozen interface list` lists all"

    def _unknown(self, name: str, package: str) -> str:
        known = [f"{package}/{each}" for each in self.places.names(package)]
        if not known:
            there = self.places.packages()
            hint = suggest(package, there) or f"; known: {listed(there, MAX_SHOWN)}"
            return (
                f"no package {package!r} with interfaces{hint}; give its folder: --package "
                f"{package}=DIR"
            )
        last = last_part(name)
        elsewhere = [
            full
            for full in self.names()
            if full.endswith(f"/msg/{last}" if self._open else f"/{last}")
        ]
        if self._open:  # a file names messages only, without their kind
            if near := OTHER_WORDS.get(last, last.lower() if last.lower() in PRIMITIVES else ""):
                return f"no type {name!r}; write {near}"
            name, known, elsewhere = (
                _short(name),
                [*map(_short, known), *PRIMITIVES],
                [*map(_short, elsewhere)],
            )
        if elsewhere:
            return f"no type {name!r}; write {' or '.join(elsewhere)}"
        return (
            "no type "
            f"{name!r}{suggest(name, known, last_part) or '; known: ' + listed(known, MAX_SHOWN)}"
        )


def _check_file(where: str, name: str) -> None:
    """Raise InterfaceError for the name of a definition that ROS 2 refuses."""
    if not re.fullmatch("[A-Z][A-Za-z0-9]*", name):
        right = "".join(word[:1].upper() + word[1:] for word in name.split("_"))
        rule = "ROS 2 allows letters and digits, the first an upper-case letter"
        raise InterfaceError(f"{where}: {name!r} is not a valid name of a type; {rule}: {right}")


def _short(name: str) -> str:
    return name.replace("/msg/", "/")


def _file(name: str) -> str:
    """The name of the file that defines `srv/Trigger_Request` or
    `action/Fibonacci_SendGoal_Request`, such as `srv/Trigger`.
    """
    ends = {"msg": (), "srv": _HALVES, "action": _PARTS}[name.partition("/")[0]]
    return next((name.removesuffix(end) for end in ends if name.endswith(end)), name)


def full_name(name: str) -> str:
    """A full type name as ROS 2 writes it. Raises InterfaceError if package, kind or name are
    missing.
    """
    package, kind, last = _parts(name)
    if not kind:
        raise InterfaceError(f"{name!r} does not specify msg, srv or action")
    return f"{package}/{kind}/{last}"


def _parts(name: str) -> tuple[str, str, str]:
    """Package, kind (empty if none) and name. DDS spelling is read too:
    geometry_msgs::msg::dds_::Twist_.
    """
    plain = (
        name.replace("::dds_::", "::").removesuffix("_").replace("::", "/")
        if "::" in name
        else name
    )
    found = _NAME.fullmatch(plain)
    if not found:
        raise InterfaceError(
            f"{name[:80]!r} is not a type; write PACKAGE/msg/NAME, such as geometry_msgs/msg/Twist"
        )
    return found[1], found[2] or "", found[3]
