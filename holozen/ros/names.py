"""Names of nodes, topics and services by ROS's rules: checked, made absolute, remapped, and as keys of Zenoh."""

import re
from dataclasses import dataclass
from typing import NoReturn

from holozen.ros.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
)

LONGEST = 247  # characters of a full topic name
LONGEST_NODE = 255
NOT_A_TOKEN = re.compile(r"[^A-Za-z0-9_]")
SUBSTITUTION = re.compile(r"\{([^{}]*)\}")
SCHEMES = {"rostopic://": "topic", "rosservice://": "service"}


def key(full: str) -> str:
    """The Zenoh key of an absolute name: `cmd_vel` of `/cmd_vel`."""
    return full.removeprefix("/")


def join(namespace: str, name: str) -> str:
    """The absolute name of `name` in a namespace."""
    return f"{namespace.rstrip('/')}/{name}"


def check_node_name(name: str) -> str:
    """`name` if it may be a node's. Raises InvalidNodeNameException."""
    place, fault = _token_fault(_text(name, "a node's name"))
    if not name:
        raise InvalidNodeNameException(name, "it is empty", 0)
    if fault:
        raise InvalidNodeNameException(name, fault, place)
    if len(name) > LONGEST_NODE:
        raise InvalidNodeNameException(name, f"it is longer than {LONGEST_NODE} characters", LONGEST_NODE)
    return name


def check_namespace(name: str) -> str:
    """A namespace with its first slash, which may be left out. Raises InvalidNamespaceException."""
    full = name if _text(name, "a namespace").startswith("/") else f"/{name}"
    fault = _path_fault(full) if full != "/" else None
    if fault:
        raise InvalidNamespaceException(full, fault[1], fault[0])
    return full


def expand(name: str, node: str, namespace: str, *, kind: str = "topic") -> str:
    """The absolute name that `name` means in a node: absolute, relative, or private with `~`; `{node}` is filled in.

    Raises InvalidTopicNameException, or InvalidServiceNameException where `kind` is "service".
    """

    def refuse(place: int, fault: str) -> NoReturn:
        raise (InvalidServiceNameException if kind == "service" else InvalidTopicNameException)(name, fault, place)

    if not _text(name, f"a {kind}'s name"):
        refuse(0, "it is empty")
    known = {"node": node, "ns": namespace, "namespace": namespace}
    for found in SUBSTITUTION.finditer(name):
        if found[1] not in known:
            refuse(found.start(), f"{found[0]} is nothing that is filled in; use {{node}}, {{ns}} or {{namespace}}")
    full = SUBSTITUTION.sub(lambda found: known[found[1]], name)
    if "~" in full[1:]:
        refuse(full.rindex("~"), "~ stands only at the start")
    if full.startswith("~"):
        if not full.startswith("~/") and full != "~":
            refuse(1, "write ~/ before a name")
        full = join(namespace, node) + full[1:]
    elif not full.startswith("/"):
        full = join(namespace, full)
    if fault := _path_fault(full):
        # Where the name was only made longer at its start, the place is told in what was written.
        refuse(max(0, fault[0] - max(0, len(full) - len(name))), fault[1])
    if len(full) > LONGEST:
        refuse(LONGEST, f"{full!r} is longer than {LONGEST} characters")
    return full


@dataclass(frozen=True, slots=True)
class Remap:
    """One rule: a name, `__node` or `__ns` that becomes another. `only` is the node it is for (empty: all)."""

    match: str
    replacement: str
    only: str = ""

    def applies_to(self, node: str) -> bool:
        """Whether it is a rule for that node."""
        return self.only in ("", node)

    def renames(self, full: str, node: str, namespace: str, kind: str) -> bool:
        """Whether it is a rule for that absolute name of a topic or a service in a node."""
        match, of = self.match, kind
        for scheme, its in SCHEMES.items():
            if match.startswith(scheme):
                match, of = match.removeprefix(scheme), its
        if not self.applies_to(node) or match.startswith("__") or of != kind:
            return False
        return expand(match, node, namespace, kind=kind) == full


def remap(text: str) -> Remap:
    """The rule that `from:=to` or `node:from:=to` says. Raises ValueError."""
    match, sign, replacement = text.partition(":=")
    if not sign or not match or not replacement:
        raise ValueError("write FROM:=TO, or NODE:FROM:=TO")
    only = ""
    if ":" in match.replace("://", ""):
        only, _, match = match.partition(":")
        check_node_name(only)
    if match in ("__node", "__name"):
        return Remap("__node", check_node_name(replacement), only)
    if match == "__ns":
        return Remap("__ns", _absolute(replacement), only)
    if match.startswith("__"):
        raise ValueError(f"{match} is nothing that is remapped; use __node, __ns, or a name")
    bare = match
    for scheme in SCHEMES:
        bare = bare.removeprefix(scheme)
    for name in (bare, replacement):
        expand(name, "node", "/")
    return Remap(match, replacement, only)


def _absolute(namespace: str) -> str:
    if not namespace.startswith("/"):
        raise InvalidNamespaceException(namespace, "it does not begin with /", 0)
    return check_namespace(namespace)


def _text(name: object, what: str) -> str:
    if not isinstance(name, str):
        raise TypeError(f"{what} is a str, and {name!r} is a {type(name).__name__}")
    return name


def _token_fault(name: str) -> tuple[int, str]:
    if bad := NOT_A_TOKEN.search(name):
        return bad.start(), f"{bad[0]!r} may not be in it; use letters, digits and _"
    return (0, "it begins with a digit") if name[:1].isdigit() else (0, "")


def _path_fault(full: str) -> tuple[int, str] | None:
    """What is wrong with an absolute name, and where."""
    if len(full) > 1 and full.endswith("/"):
        return len(full) - 1, "it ends with /"
    place = 1
    for part in full[1:].split("/"):
        if not part:
            return place, "a part between two / is empty"
        offset, fault = _token_fault(part)
        if fault:
            return place + offset, fault if "begins" not in fault else f"{part!r} begins with a digit"
        place += len(part) + 1
    return None
