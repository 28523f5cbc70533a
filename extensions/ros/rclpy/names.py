"""Names of nodes, topics and services by ROS's rules: validated, expanded, remapped, and as Zenoh
keys.
"""

import re
from typing import NoReturn

from msgspec import Struct

from holozen.ros.rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
)
from holozen.suggest import article

MAX_NAME = 247  # characters of a full topic name
LONGEST_NODE = 255
NOT_A_TOKEN = re.compile(r"[^A-Za-z0-9_]")
SUBSTITUTION = re.compile(r"\{([^{}]*)\}")
SCHEMES = {"rostopic://": "topic", "rosservice://": "service"}


def key(full: str) -> str:
    """The Zenoh key of an absolute name: `cmd_vel` for `/cmd_vel`."""
    return full.removeprefix("/")


def join(namespace: str, name: str) -> str:
    """The absolute name of `name` in a namespace."""
    return f"{namespace.rstrip('/')}/{name}"


def check_node_name(name: str) -> str:
    """`name` if it is valid for a node. Raises InvalidNodeNameException."""
    place, fault = _token_fault(text_of(name, "the name of a node"))
    if not name:
        raise InvalidNodeNameException(name, "it is empty", 0)
    if fault:
        raise InvalidNodeNameException(name, fault, place)
    if len(name) > LONGEST_NODE:
        raise InvalidNodeNameException(
            name, f"it is longer than {LONGEST_NODE} characters", LONGEST_NODE
        )
    return name


def check_namespace(name: str) -> str:
    """A namespace with its leading slash, which may be omitted. Raises
    InvalidNamespaceException.
    """
    full = name if text_of(name, "a namespace").startswith("/") else f"/{name}"
    fault = _path_fault(full) if full != "/" else None
    if fault:
        raise InvalidNamespaceException(full, fault[1], fault[0])
    return full


def expand(name: str, node: str, namespace: str, *, kind: str = "topic") -> str:
    """The absolute name of an absolute, relative or private (`~`) one in a node; substitutes
    `{node}` and `{ns}`.

    Raises InvalidTopicNameException, or InvalidServiceNameException if `kind` is "service".
    """

    def refuse(place: int, fault: str) -> NoReturn:
        raise (InvalidServiceNameException if kind == "service" else InvalidTopicNameException)(
            name, fault, place
        )

    if not text_of(name, f"the name of a {kind}"):
        refuse(0, "it is empty")
    known = {"node": node, "ns": namespace, "namespace": namespace}
    if unknown := next((one for one in SUBSTITUTION.finditer(name) if one[1] not in known), None):
        hint = "use {node}, {ns} or {namespace}"
        refuse(unknown.start(), f"{unknown[0]} is not a substitution; {hint}")
    full = SUBSTITUTION.sub(lambda found: known[found[1]], name)
    if "~" in full[1:]:
        refuse(full.rindex("~"), "~ is only allowed at the start")
    if full.startswith("~"):
        if not full.startswith("~/") and full != "~":
            refuse(1, "write ~/ before a name")
        full = join(namespace, node) + full[1:]
    elif not full.startswith("/"):
        full = join(namespace, full)
    if fault := _path_fault(full):
        # The name may only have grown at its start; the position refers to what was written.
        refuse(max(0, fault[0] - max(0, len(full) - len(name))), fault[1])
    if len(full) > MAX_NAME:
        refuse(MAX_NAME, f"{full!r} is longer than {MAX_NAME} characters")
    return full


class Remap(Struct, frozen=True):
    """One remap rule: a name, `__node` or `__ns`, and its replacement. `only` is the node it is for
    (empty: all).
    """

    match: str
    replacement: str
    only: str = ""

    def applies_to(self, node: str) -> bool:
        """Whether the rule is for that node."""
        return self.only in ("", node)

    def renames(self, full: str, node: str, namespace: str, kind: str) -> bool:
        """Whether the rule is for that absolute name of a topic or a service in a node."""
        match, of = self.match, kind
        for scheme, its in SCHEMES.items():
            if match.startswith(scheme):
                match, of = match.removeprefix(scheme), its
        if not self.applies_to(node) or match.startswith("__") or of != kind:
            return False
        return expand(match, node, namespace, kind=kind) == full


def remap(text: str) -> Remap:
    """The rule of `from:=to` or `node:from:=to`. Raises ValueError."""
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
        if not replacement.startswith("/"):
            raise InvalidNamespaceException(replacement, "it does not start with /", 0)
        return Remap("__ns", check_namespace(replacement), only)
    if match.startswith("__"):
        raise ValueError(f"{match} cannot be remapped; use __node, __ns, or a name")
    bare = match
    for scheme in SCHEMES:
        bare = bare.removeprefix(scheme)
    for name in (bare, replacement):
        expand(name, "node", "/")
    return Remap(match, replacement, only)


def text_of(name: object, what: str) -> str:
    """`name`. Raises TypeError for anything but a str."""
    if not isinstance(name, str):
        raise TypeError(f"{what} must be a str; {name!r} is {article(type(name).__name__)}")
    return name


def _token_fault(name: str) -> tuple[int, str]:
    if bad := NOT_A_TOKEN.search(name):
        return bad.start(), f"{bad[0]!r} is not allowed; use letters, digits and _"
    return (0, "it starts with a digit") if name[:1].isdigit() else (0, "")


def _path_fault(full: str) -> tuple[int, str] | None:
    """What is wrong with an absolute name, and at which character."""
    if len(full) > 1 and full.endswith("/"):
        return len(full) - 1, "it ends with /"
    place = 1
    for part in full[1:].split("/"):
        if not part:
            return place, "two / in a row"
        offset, fault = _token_fault(part)
        if fault:
            return (
                place + offset,
                fault if "starts" not in fault else f"{part!r} starts with a digit",
            )
        place += len(part) + 1
    return None
