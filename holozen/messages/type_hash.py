"""RIHS01, the hash by which ROS 2 (from Iron on) checks whether two nodes have the same definition
of a type.

It is the SHA-256 of the type's description in JSON, in the exact form of ROS's REP 2011 and its
package rosidl: names and types of all fields, in order, and those of the types nested in it, sorted
by name. Constants and defaults do not count.
"""

import hashlib
import json
from functools import cache
from typing import Any

from holozen.messages.definitions import Field, Interface

# type_description_interfaces/msg/FieldType
_NESTED = 1
_IDS = {
    "int8": 2,
    "uint8": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "char": 3,
    "bool": 15,
    "byte": 16,
    "string": 17,
    "wstring": 18,
}
_BOUNDED_TEXT = 4  # from a string to a bounded string
_ARRAYS = {"": 0, "fixed": 48, "bounded": 96, "sequence": 144}

_NO_FIELDS = (Field("structure_needs_at_least_one_member", "uint8"),)
_TIME = Interface(
    "builtin_interfaces/msg/Time", "msg", (Field("sec", "int32"), Field("nanosec", "uint32"))
)
_EVENT_INFO = Interface(
    "service_msgs/msg/ServiceEventInfo",
    "msg",
    (
        Field("event_type", "uint8"),
        Field("stamp", _TIME.name, nested=_TIME),
        Field("client_gid", "char", "fixed", 16),
        Field("sequence_number", "int64"),
    ),
)

Description = dict[str, Any]


@cache
def type_hash(interface: Interface) -> str:
    """The hash of a message or a service, such as `RIHS01_` and 64 hexadecimal digits."""
    nested: dict[str, Description] = {}
    described = _described(_with_event(interface) if interface.kind == "srv" else interface, nested)
    whole = {
        "type_description": described,
        "referenced_type_descriptions": [nested[name] for name in sorted(nested)],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(whole).encode()).hexdigest()}"


def _described(interface: Interface, nested: dict[str, Description]) -> Description:
    fields = [_field(field, nested) for field in interface.fields or _NO_FIELDS]
    return {"type_name": interface.name, "fields": fields}


def _field(field: Field, nested: dict[str, Description]) -> Description:
    if field.nested and field.nested.name not in nested:
        nested[field.nested.name] = {}  # its place, before those that are nested in it
        nested[field.nested.name] = _described(field.nested, nested)
    number = _NESTED if field.nested else _IDS[field.type] + (_BOUNDED_TEXT if field.longest else 0)
    kind = {
        "type_id": number + _ARRAYS[field.array],
        "capacity": field.bound,
        "string_capacity": field.longest,
        "nested_type_name": field.type if field.nested else "",
    }
    return {"name": field.name, "type": kind}


def _with_event(service: Interface) -> Interface:
    """A service as a message of three messages: the third reports calls to observers
    (service_msgs).
    """
    request, response = service.parts
    event = Interface(
        f"{service.name}_Event",
        "msg",
        (
            Field("info", _EVENT_INFO.name, nested=_EVENT_INFO),
            Field("request", request.name, "bounded", 1, nested=request),
            Field("response", response.name, "bounded", 1, nested=response),
        ),
    )
    parts = {"request_message": request, "response_message": response, "event_message": event}
    return Interface(
        service.name,
        "msg",
        tuple(Field(name, part.name, nested=part) for name, part in parts.items()),
    )
