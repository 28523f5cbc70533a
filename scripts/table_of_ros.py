"""The tables of docs/coming-from-ros.md, made from the code: every name of ROS that scripts find
here.
"""

from collections.abc import Iterable
from enum import Enum
from importlib import import_module
from typing import Any

from holozen.messages.registry import tables
from holozen.ros.catalog import HINTS, INTERNAL, MODULES, REEXPORTS


def table() -> str:
    """A row for each module, class and name that is not here."""
    modules = [
        row(aliases(ours), import_module(ours).__all__) for ours in dict.fromkeys(MODULES.values())
    ]
    reexports = [row(f"`{module}`", sorted(names)) for module, names in REEXPORTS.items()]
    members = [row(f"`{kind.__name__}`", public(kind)) for kind in classes()]
    packages = ", ".join(f"`{name}`" for name in sorted({*tables()} - {"holozen"}))
    instead = [
        f"| `{name}` | {hint.replace('|', chr(92) + '|')} |" for name, hint in sorted(HINTS.items())
    ]
    rows = ["| module | its names |", "|---|---|", *modules]
    rows += [
        "\n| module | names that it has from other modules, as in ROS |",
        "|---|---|",
        *reexports,
    ]
    rows += ["\n| class | its members |", "|---|---|", *members]
    rows += [f"\nInterfaces: {packages}, and those of any package that is found."]
    return "\n".join([*rows, "\n| not here | instead |", "|---|---|", *instead])


def aliases(ours: str) -> str:
    """The names under which scripts find a module of ours."""
    return ", ".join(f"`{module}`" for module, behind in MODULES.items() if behind == ours)


def classes() -> list[type]:
    """The classes of rclpy and tf2_ros that have members of their own, once each."""
    found: dict[str, Any] = {}
    for module, ours in MODULES.items():
        if module.partition(".")[0] in ("rclpy", "tf2_ros"):
            for name in import_module(ours).__all__:
                value = getattr(import_module(ours), name)
                if (
                    isinstance(value, type)
                    and not issubclass(value, BaseException | Enum)
                    and public(value)
                ):
                    found.setdefault(value.__name__, value)
    return [found[name] for name in sorted(found)]


def public(kind: type) -> list[str]:
    """The public attributes that our classes define, without those of Python's own."""
    owners = [base for base in kind.__mro__ if base.__module__.startswith("holozen.")]
    return sorted(
        {
            name
            for base in owners
            for name in vars(base)
            if not name.startswith("_") and name not in INTERNAL
        }
    )


def row(head: str, names: Iterable[str]) -> str:
    return f"| {head} | {', '.join(f'`{name}`' for name in names)} |"


if __name__ == "__main__":
    print(table())
