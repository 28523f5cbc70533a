"""RIHS01, the hash of a type by which ROS 2 (from Iron on) checks whether two nodes mean the same type.

It is the SHA-256 of the type's description in JSON, in the exact form of ROS's REP 2011 and its package rosidl: names
and types of all fields, in order, and those of the types nested in it, sorted by name. Constants and defaults do not
count.
"""

import hashlib
import json
from functools import cache
from typing import Any

from holozen.messages.definitions import Field, Interface

# type_description_interfaces/msg/FieldType
_NESTED = 1
_IDS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9, "float32": 10,
    "float64": 11, "char": 3, "bool": 15, "byte": 16, "string": 17, "wstring": 18,
}  # fmt: skip
_BOUNDED_TEXT = 4  # from a string to a bounded string
_ARRAYS = {"": 0, "fixed": 48, "bounded": 96, "sequence": 144}

_TIME = "builtin_interfaces/msg/Time"
_EVENT_INFO = "service_msgs/msg/ServiceEventInfo"

Description = dict[str, Any]


@cache
def type_hash(interface: Interface) -> str:
    """The hash of a message or a service, such as `RIHS01_` and 64 hexadecimal digits."""
    nested: dict[str, Description] = {}
    described = _service(interface, nested) if interface.kind == "srv" else _message(interface, nested)
    whole = {"type_description": described, "referenced_type_descriptions": [nested[name] for name in sorted(nested)]}
    return f"RIHS01_{hashlib.sha256(json.dumps(whole).encode()).hexdigest()}"


def _message(interface: Interface, nested: dict[str, Description]) -> Description:
    fields = [_field(field, nested) for field in interface.fields]
    return _described(interface.name, *fields or [_plain("structure_needs_at_least_one_member", "uint8")])


def _field(field: Field, nested: dict[str, Description]) -> Description:
    if field.nested and field.nested.name not in nested:
        nested[field.nested.name] = {}  # its place, before those that are nested in it
        nested[field.nested.name] = _message(field.nested, nested)
    number = _NESTED if field.nested else _IDS[field.type] + (_BOUNDED_TEXT if field.longest else 0)
    return _typed(
        field.name, number + _ARRAYS[field.array], field.bound, field.longest, field.type * bool(field.nested)
    )


def _service(interface: Interface, nested: dict[str, Description]) -> Description:
    """A service has three messages: the third reports calls to observers (service_msgs)."""
    assert interface.request
    assert interface.response
    halves = [interface.request, interface.response]
    for half in halves:
        nested[half.name] = _message(half, nested)
    event = f"{interface.name}_Event"
    sequences = [
        _typed(name, _NESTED + _ARRAYS["bounded"], 1, 0, half.name)
        for name, half in zip(("request", "response"), halves, strict=True)
    ]
    nested[event] = _described(event, _part("info", _EVENT_INFO), *sequences)
    nested[_EVENT_INFO] = _described(
        _EVENT_INFO,
        _plain("event_type", "uint8"),
        _part("stamp", _TIME),
        _typed("client_gid", _IDS["char"] + _ARRAYS["fixed"], 16),
        _plain("sequence_number", "int64"),
    )
    nested[_TIME] = _described(_TIME, _plain("sec", "int32"), _plain("nanosec", "uint32"))
    parts = zip(
        ("request_message", "response_message", "event_message"), [*(h.name for h in halves), event], strict=True
    )
    return _described(interface.name, *(_part(name, kind) for name, kind in parts))


def _described(name: str, *fields: Description) -> Description:
    return {"type_name": name, "fields": list(fields)}


def _plain(name: str, kind: str) -> Description:
    return _typed(name, _IDS[kind])


def _part(name: str, kind: str) -> Description:
    return _typed(name, _NESTED, nested=kind)


def _typed(name: str, number: int, capacity: int = 0, longest: int = 0, nested: str = "") -> Description:
    kind = {"type_id": number, "capacity": capacity, "string_capacity": longest, "nested_type_name": nested}
    return {"name": name, "type": kind}
