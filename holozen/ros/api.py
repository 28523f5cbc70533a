"""The table of docs/coming-from-ros.md: every name that scripts find here, read off the code."""

from collections.abc import Iterable
from enum import Enum
from importlib import import_module
from typing import Any

from holozen.interfaces.places import tables
from holozen.ros.missing import HINTS, INNER
from holozen.ros.table import IMPORTED, MODULES, imported


def table() -> str:
    """The modules, their classes, the packages of interfaces and what there is instead of others, as Markdown."""
    modules = [_row(_aliases(ours), _names(ours)) for ours in dict.fromkeys(MODULES.values())]
    imports = [_row(f"`{module}`", sorted(imported(module))) for module in IMPORTED]
    classes = [_row(f"`{kind.__name__}`", _public(kind)) for kind in _classes()]
    packages = ", ".join(f"`{name}`" for name in sorted({*tables()} - {"holozen"}))
    instead = [f"| `{name}` | {_escaped(hint)} |" for name, hint in sorted(HINTS.items())]
    return "\n".join(
        [
            *("| module | what it has |", "|---|---|", *modules, ""),
            *("| module | what it has too, as ROS's does |", "|---|---|", *imports, ""),
            *("| class | what it has |", "|---|---|", *classes, ""),
            f"Interfaces: {packages}, and those of any package that is found.",
            *("", "| not here | instead |", "|---|---|", *instead),
        ]
    )


def _aliases(ours: str) -> str:
    """The names under which scripts find a module of ours."""
    return ", ".join(f"`{module}`" for module, behind in MODULES.items() if behind == ours)


def _names(ours: str) -> list[str]:
    names: list[str] = import_module(ours).__all__
    return names


def _classes() -> list[type]:
    """The classes of rclpy and tf2_ros that do something of their own, once each."""
    found: dict[str, Any] = {}
    for module, ours in MODULES.items():
        if module.partition(".")[0] in ("rclpy", "tf2_ros"):
            for name in _names(ours):
                value = getattr(import_module(ours), name)
                if isinstance(value, type) and not issubclass(value, BaseException | Enum) and _public(value):
                    found.setdefault(value.__name__, value)
    return [found[name] for name in sorted(found)]


def _public(kind: type) -> list[str]:
    """The public attributes that are ours, and not those of Python's own classes."""
    owners = [base for base in kind.__mro__ if base.__module__.startswith("holozen.")]
    return sorted({name for base in owners for name in vars(base) if not name.startswith("_") and name not in INNER})


def _row(head: str, names: Iterable[str]) -> str:
    return f"| {head} | {', '.join(f'`{name}`' for name in names)} |"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|")
