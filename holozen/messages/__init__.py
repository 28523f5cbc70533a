"""ROS messages as msgspec Structs, one file per ROS package, and what reads and writes them.

Units and frames are those of ROS (REP 103, REP 105): metres, radians, seconds; x forward, y left, z
up. The Structs are the source of their types: `scripts/definitions` writes interfaces/structs.txt
from them.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from holozen.messages.builtin_interfaces import *
    from holozen.messages.gazebo_msgs import *
    from holozen.messages.geometry_msgs import *
    from holozen.messages.holozen import *
    from holozen.messages.message import *
    from holozen.messages.message import Message as Message
    from holozen.messages.nav_msgs import *
    from holozen.messages.rosgraph_msgs import *
    from holozen.messages.sensor_msgs import *
    from holozen.messages.std_msgs import *
    from holozen.messages.std_srvs import *
    from holozen.messages.tf2_msgs import *
else:
    # Loaded on first use: definitions and CDR alone need no msgspec, which takes 15 ms of the start
    # of an echo.
    MODULES = (
        "message",
        "builtin_interfaces",
        "std_msgs",
        "geometry_msgs",
        "nav_msgs",
        "sensor_msgs",
        "tf2_msgs",
        "rosgraph_msgs",
        "std_srvs",
        "gazebo_msgs",
        "holozen",
    )

    def __getattr__(name: str) -> Any:
        import importlib

        modules = (vars(importlib.import_module(f"{__name__}.{module}")) for module in MODULES)
        if name == "__all__":  # of `from holozen.messages import *`
            structs = {
                each
                for module in modules
                for each in module
                if hasattr(module[each], "__struct_fields__")
            }
            return sorted(structs - {"Struct"})
        if name[0].isupper():
            for module in modules:
                if found := module.get(name):
                    return globals().setdefault(name, found)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


WIRES = {"json": "application/json", "cdr": "application/cdr"}
"""The names that `--wire` takes, and the Encoding of each."""


def encoding_of(wire: str, type_name: str) -> str:
    """The Encoding of a message. CDR does not describe itself, so its type is appended, as Zenoh's
    schema, if known.
    """
    return f"{WIRES[wire]};{type_name}" if wire == "cdr" and type_name else WIRES[wire]


def named(name: str) -> "type[Message]":
    """The Struct with that name in ROS; for a service that of a half, such as
    `std_srvs/srv/Trigger_Request`.
    """
    from importlib import import_module

    package, _, last = name.split("/")
    struct = last.replace("_Request", "Request").replace("_Response", "Reply")
    found: type[Message] = getattr(import_module(f"{__name__}.{package}"), struct)
    return found


class CodecError(ValueError):
    """Bytes that are not the expected message, or a message that cannot be encoded. The text is one
    line.
    """
