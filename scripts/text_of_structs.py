"""The definitions of the Structs in holozen/messages, in the language of .msg, .srv and .action
files.
"""

import importlib
import pkgutil
import typing
from collections.abc import Iterator
from typing import Any

import msgspec

import holozen.messages
from holozen.messages.action import ActionPart
from holozen.messages.message import Message

PRIMITIVES = {float: "float64", int: "int64", str: "string", bool: "bool"}


def text() -> str:
    """The definitions of all Structs of holozen.messages, as interfaces/structs.txt holds them."""
    for module in pkgutil.iter_modules(holozen.messages.__path__):
        importlib.import_module(f"{holozen.messages.__name__}.{module.name}")
    halves: dict[str, list[str]] = {}
    parts = ("Reply", "Result", "Feedback")  # after a request, or a goal
    kinds = (*(set(Message.__subclasses__()) - {ActionPart}), *ActionPart.__subclasses__())
    for kind in sorted(
        kinds,
        key=lambda kind: next(
            (parts.index(end) for end in parts if kind.__name__.endswith(end)), -1
        ),
    ):
        name, _, part = (
            kind.ROS.rpartition("_") if "/action/" in kind.ROS else (kind.ROS, "", "Goal")
        )
        if kind.__module__.startswith(f"{holozen.messages.__name__}.") and part in (
            "Goal",
            "Result",
            "Feedback",
        ):
            halves.setdefault(name, []).append("".join(f"{line}\n" for line in lines(kind)))
    return "\n".join(f"[{name}]\n" + "---\n".join(texts) for name, texts in sorted(halves.items()))


def lines(kind: type[Message]) -> Iterator[str]:
    """The lines of a .msg file."""
    hints = typing.get_type_hints(kind, include_extras=True)
    for name in (name for name in vars(kind) if name.isupper() and name not in vars(Message)):
        yield f"{spelled(typing.get_args(hints[name])[0], kind)} {name}={getattr(kind, name)}"
    for field in msgspec.structs.fields(kind):
        default = (
            f" {field.default}" if field.default and field.default is not msgspec.NODEFAULT else ""
        )
        yield f"{spelled(hints[field.name], kind)} {field.name}{default}"


def spelled(hint: Any, owner: type[Message]) -> str:
    """The type of a field as a .msg file in the package of `owner` spells it."""
    ends = "[]"
    if typing.get_origin(hint) is typing.Annotated:
        hint, meta = typing.get_args(hint)
        if meta.extra:
            return str(meta.extra["ros"])
        ends = f"[{'<=' if meta.min_length is None else ''}{meta.max_length}]"
    if typing.get_origin(hint) is list:
        return spelled(typing.get_args(hint)[0], owner) + ends
    if hint in PRIMITIVES:
        return PRIMITIVES[hint]
    package, _, name = hint.ROS.partition("/msg/")
    return str(name) if owner.ROS.startswith(f"{package}/") else f"{package}/{name}"
