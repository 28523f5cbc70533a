"""Values of parameters for nodes, from ROS's files and command lines, and which of them are for one node.

/ns/talker:
  ros__parameters:
    speed: 0.3
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from holozen.ros import yaml_values
from holozen.ros.yaml_values import Value

HERE = "ros__parameters"
EVERY = "/**"


@dataclass(frozen=True, slots=True)
class Section:
    """The values for a node, or for all that its wildcards take: `*` is one part of a name, `**` any number."""

    place: str
    values: dict[str, Value]

    def is_for(self, fqn: str) -> bool:
        """Whether the node of that absolute name is meant."""
        return bool(re.fullmatch("".join(_pattern(part) for part in self.place.split("/")[1:]), fqn))


def assigned(text: str) -> Section:
    """What `name:=value` or `node:name:=value` says. Raises ValueError."""
    name, sign, rest = text.partition(":=")
    if not sign or not name:
        raise ValueError("write NAME:=VALUE, or NODE:NAME:=VALUE")
    node, colon, name = name.rpartition(":")
    if not name or (colon and not node):
        raise ValueError("write NAME:=VALUE, or NODE:NAME:=VALUE")
    value = yaml_values.value(rest)
    return Section(_place(node) if node else EVERY, dict(_flat({name: value}, "")))


def read(path: str) -> list[Section]:
    """The sections of a file, those with wildcards first. Raises ValueError with one line."""
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read(yaml_values.LARGEST + 1)
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: it is not UTF-8 text") from None
    try:
        found = list(_sections(yaml_values.document(text), ""))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return sorted(found, key=lambda section: "*" not in section.place)


def _sections(node: dict[str, Any], place: str) -> Iterator[Section]:
    for name, inner in node.items():
        if name == HERE and place:
            if not isinstance(inner, dict) and inner != "":
                raise ValueError(f"{HERE} of {place} has no names with values")
            yield Section(place, dict(_flat(inner or {}, "")))
        elif isinstance(inner, dict):
            yield from _sections(inner, place + _place(name))
        else:
            what = f"section {place}" if place else "the file"
            raise ValueError(
                f"{what} has a value for {name!r} outside of {HERE}; write NODE: {{{HERE}: {{NAME: VALUE}}}}"
            )


def _flat(values: dict[str, Any], prefix: str) -> Iterator[tuple[str, Value]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _place(name: str) -> str:
    return "/" + name.strip("/")


def _pattern(part: str) -> str:
    if part == "**":
        return "(/[^/]+)*"
    return "/" + re.escape(part).replace(r"\*", "[^/]*")
