"""Schemas of messages, in the forms that viewers of bags (Foxglove, Lichtblick) and ROS 2 read.

Viewers find out what to draw by the schema's name, which is the one of ROS: `nav_msgs/msg/Odometry`. Their readers of
JSON schemas know no `$ref`, so everything stands in place. For CDR it is the text of the .msg files, one after another.
"""

import json
from functools import cache, lru_cache
from typing import Any

import msgspec

from holozen import wire
from holozen.interfaces import Interface, InterfaceError, Registry
from holozen.messages import Message

BETWEEN = "=" * 80  # stands between two definitions
KEPT = ("type", "items", "properties")


@cache
def known() -> dict[str, type[Message]]:
    """The messages that travel on topics, by their ROS names."""
    return {kind.ROS: kind for row in wire.TOPICS for kind in row.types}


@cache
def json_schema(kind: type[Message]) -> bytes:
    """The JSON schema of a message."""
    schema = msgspec.json.schema(kind)
    return json.dumps({"title": kind.ROS, **_in_place(schema, schema.get("$defs", {}))}).encode()


def _in_place(schema: dict[str, Any], parts: dict[str, Any]) -> dict[str, Any]:
    """`schema` with each reference replaced by what it names, and without what viewers do not read."""
    if "$ref" in schema:
        return _in_place(parts[schema["$ref"].rpartition("/")[2]], parts)
    plain: dict[str, Any] = {name: value for name, value in schema.items() if name in KEPT}
    if isinstance(plain.get("items"), dict):
        plain["items"] = _in_place(plain["items"], parts)
    if plain["type"] == "object":  # a viewer expects properties, also of a free mapping
        fields = plain.get("properties", {})
        plain["properties"] = {name: _in_place(field, parts) for name, field in fields.items()}
    return plain


@lru_cache(maxsize=1024)
def msg_schema(name: str) -> bytes:
    """The definition of a ROS type and of all it is made of; empty if nobody knows it."""
    try:
        interface = _registry().find(name)
    except InterfaceError:
        return b""
    parts: dict[str, Interface] = {}
    _collect(interface, parts)
    others = [f"{BETWEEN}\nMSG: {one.name.replace('/msg/', '/')}\n{_definition(one)}" for one in parts.values()]
    return "\n".join([_definition(interface), *others]).encode()


@cache
def _registry() -> Registry:
    return Registry()


def _collect(interface: Interface, found: dict[str, Interface]) -> None:
    for field in interface.fields:
        if field.nested and field.nested.name not in found:
            found[field.nested.name] = field.nested
            _collect(field.nested, found)


def _definition(interface: Interface) -> str:
    constants = [f"{one.type} {one.name}={one.value}" for one in interface.constants]
    fields = []
    for field in interface.fields:
        default = "" if field.default is None else f" {json.dumps(field.default)}"
        fields.append(f"{field.spelled()} {field.name}{default}")
    return "\n".join(constants + fields)
