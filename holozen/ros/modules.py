"""Fills the modules that scripts import: those of ROS's libraries from ours, those of interfaces with classes."""

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any

from holozen.interfaces import InterfaceError
from holozen.interfaces.places import Places
from holozen.ros import generated, missing
from holozen.ros.table import MODULES, imported

Fill = Callable[[ModuleType], None]


def library(module: ModuleType) -> None:
    """A module of the table: what ours has in `__all__`."""
    name = module.__name__
    ours = import_module(MODULES[name])
    for each in ours.__all__:
        value = module.__dict__[each] = getattr(ours, each)
        if isinstance(value, type) and issubclass(value, BaseException) and value.__module__.startswith("holozen."):
            value.__module__ = name  # a traceback shows it
    others = imported(name)

    def lacking(wanted: str) -> Any:
        if wanted in others:
            value = module.__dict__[wanted] = getattr(import_module(others[wanted]), wanted)
            return value
        if f"{name}.{wanted}" in MODULES:
            return import_module(f"{name}.{wanted}")
        if wanted.startswith("__"):  # who walks over all modules asks for these
            raise AttributeError(f"{name} has no {wanted!r}")
        raise AttributeError(missing.in_module(name, wanted, ours.__all__))

    _finish(module, ours.__doc__ or "", [*ours.__all__, *others], lacking)


def package(module: ModuleType) -> None:
    """A package of interfaces, such as geometry_msgs."""
    name = module.__name__

    def lacking(wanted: str) -> Any:
        if wanted in ("msg", "srv"):
            try:
                return import_module(f"{name}.{wanted}")
            except ImportError as error:
                raise AttributeError(str(error)) from None
        raise AttributeError(f"{name} has no {wanted!r}; it has msg and srv")

    _finish(module, f"The interfaces of {name}.", [], lacking)


def interfaces(places: Places) -> Fill:
    """Fills a module such as geometry_msgs.msg, whose classes are made when they are first asked for."""

    def fill(module: ModuleType) -> None:
        top, _, kind = module.__name__.partition(".")

        def lacking(wanted: str) -> Any:
            if wanted.startswith("_"):
                raise AttributeError(f"{module.__name__} has no {wanted!r}")
            try:
                made = module.__dict__[wanted] = generated.find(f"{top}/{kind}/{wanted}")
            except InterfaceError as error:
                # Where the file is there and is wrong, `hasattr` must not say that it is not.
                known = f"{kind}/{wanted}" in places.names(top)
                raise (ImportError if known else AttributeError)(str(error)) from None
            return made

        names = [name.partition("/")[2] for name in places.names(top) if name.startswith(f"{kind}/")]
        _finish(module, f"The {kind} interfaces of {top}.", names, lacking)

    return fill


def of_one(names: list[str]) -> Fill:
    """Fills a module such as geometry_msgs.msg._twist, where ROS keeps one class; editors write imports from there."""

    def fill(module: ModuleType) -> None:
        found = {name.rpartition("/")[2]: generated.find(name) for name in names}
        module.__dict__.update(found)

        def lacking(wanted: str) -> Any:
            raise AttributeError(f"{module.__name__} has no {wanted!r}; it has {', '.join(found)}")

        _finish(module, f"{', '.join(names)}.", [*found], lacking)

    return fill


def _finish(module: ModuleType, says: str, names: list[str], lacking: Callable[[str], Any]) -> None:
    module.__dict__.update(
        {
            "__doc__": says,
            "__all__": names,
            "__getattr__": lacking,
            "__dir__": lambda: sorted({*module.__dict__, *names}),
        }
    )
