"""Types by their names."""

import re
from collections.abc import Iterable

from holozen.interfaces import places
from holozen.interfaces.definition import Interface, InterfaceError
from holozen.interfaces.parser import parse

_NAME = re.compile(r"([A-Za-z][A-Za-z0-9_]*)/(?:(msg|srv)/)?([A-Za-z][A-Za-z0-9_]*)")
DEEPEST = 50  # messages within messages
MOST_LOST = 100  # wrong names that are kept
MOST = 20  # names in an error
_HALVES = ("_Request", "_Response")


class Registry:
    """Finds types, each parsed once.

    A package is looked up among `packages` (name -> folder, as `--package NAME=DIR` gives), in our own tables, then in
    AMENT_PREFIX_PATH, ROS_PACKAGE_PATH, around the files or folders `near` and around the working folder.
    """

    def __init__(self, packages: places.Folders = {}, near: places.Paths = ()) -> None:
        self.places = places.Places(packages, near)
        self._found: dict[str, Interface] = {}
        self._lost: dict[str, InterfaceError] = {}  # a stranger may name one with every sample
        self._open: list[str] = []  # those that are being parsed, to see one that holds itself

    def find(self, name: str) -> Interface:
        """The type called `name`: `geometry_msgs/msg/Twist`, `std_srvs/srv/Trigger`, or a service's half
        `std_srvs/srv/Trigger_Request`. Raises InterfaceError, with the closest name there is.
        """
        if name in self._found:
            return self._found[name]
        if name in self._lost:
            raise self._lost[name].with_traceback(None)
        try:
            found = self._found[name] = self._find(name)
        except InterfaceError as error:
            if not self._open and len(self._lost) < MOST_LOST:
                self._lost[name] = error
            raise
        return found

    def names(self) -> list[str]:
        """All types that can be listed, sorted."""
        known = self.places.packages()
        return [f"{package}/{name}" for package in known for name in self.places.names(package)]

    def _find(self, name: str) -> Interface:
        if re.fullmatch(r"\w+", name):
            raise InterfaceError(self._bare(name))
        package, kind, last = _parts(name)
        for each in (kind,) if kind else places.KINDS:
            if found := self._get(package, f"{each}/{last}"):
                return found
        raise InterfaceError(self._unknown(name, package))

    def _get(self, package: str, name: str) -> Interface | None:
        full = f"{package}/{name}"
        if full not in self._found:
            stem = next((name.removesuffix(half) for half in _HALVES if name.endswith(half)), name)
            whole = name if name.startswith("msg/") else stem
            source = self.places.source(package, whole)
            if source is None:
                return None
            self._keep(package, whole, source)
        return self._found.get(full)

    def _keep(self, package: str, name: str, source: places.Source) -> None:
        full, kind = f"{package}/{name}", name[:3]
        if full in self._open:
            raise InterfaceError(f"{full} holds itself: {' > '.join([*self._open, full])}")
        if len(self._open) == DEEPEST:
            raise InterfaceError(f"{self._open[0]} is nested more than {DEEPEST} deep")
        self._open.append(full)
        try:
            sections = parse(source.text, source.where, lambda other: self._nested(package, other), source.line)
            wanted = 2 if kind == "srv" else 1
            if len(sections) != wanted:
                raise InterfaceError(f"{source.where}: {len(sections) - 1} lines of '---'; a .{kind} has {wanted - 1}")
            ends = _HALVES if kind == "srv" else ("",)
            made = [Interface(full + end, "msg", *section) for end, section in zip(ends, sections, strict=True)]
        finally:
            self._open.pop()
        if kind == "srv":
            made.append(Interface(full, "srv", parts=(made[0], made[1])))
        self._found.update({interface.name: interface for interface in made})

    def _nested(self, package: str, name: str) -> Interface:
        """The message that a file of `package` calls `name`."""
        if "/" in name:
            home, kind, last = _parts(name)
            if kind == "srv":
                raise InterfaceError(f"{name}: a field is a message, not a service")
            return self.find(f"{home}/msg/{last}")
        if name == "Header" and not self.places.source(package, "msg/Header"):
            package = "std_msgs"  # as ROS 1 wrote it
        return self.find(f"{package}/msg/{name}")

    def _bare(self, name: str) -> str:
        same = [full for full in self.names() if full.rpartition("/")[2].lower() == name.lower()]
        hint = f"did you mean {' or '.join(same)}?" if same else "`holozen interface list` shows all"
        return f"{name[:80]!r} is no type, it lacks the package; {hint}"

    def _unknown(self, name: str, package: str) -> str:
        known = [f"{package}/{each}" for each in self.places.names(package)]
        if not known:
            there = self.places.packages()
            hint = closest(package, there) or f"; known: {listed(there)}"
            return f"no package {package!r} with interfaces{hint}; say where it is: --package {package}=DIR"
        return f"no type {name!r}{closest(name, known) or '; known: ' + listed(known)}"


def listed(names: list[str]) -> str:
    """The first names, and how many more there are."""
    return ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")


def closest(name: str, known: Iterable[str]) -> str:
    """`; did you mean X?` with the most similar of `known`; empty if none is similar."""
    import difflib

    folded = {each.lower().rpartition("/")[2]: each for each in known}  # what types share says nothing
    found = difflib.get_close_matches(name.lower().rpartition("/")[2], folded, 1)
    return f"; did you mean {folded[found[0]]}?" if found else ""


def full_name(name: str) -> str:
    """A type's name as ROS 2 writes it, if it says package, kind and name. Raises InterfaceError."""
    package, kind, last = _parts(name)
    if not kind:
        raise InterfaceError(f"{name!r} does not say whether it is a msg or a srv")
    return f"{package}/{kind}/{last}"


def _parts(name: str) -> tuple[str, str, str]:
    """Package, kind (empty if none) and name. DDS spelling is read too: geometry_msgs::msg::dds_::Twist_."""
    plain = name.replace("::dds_::", "::").removesuffix("_").replace("::", "/") if "::" in name else name
    found = _NAME.fullmatch(plain)
    if not found:
        raise InterfaceError(f"{name[:80]!r} is no type; write PACKAGE/msg/NAME, such as geometry_msgs/msg/Twist")
    return found[1], found[2] or "", found[3]
