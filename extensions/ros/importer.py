"""Makes ROS's modules and interface packages importable in this process.

Two finders on sys.meta_path do so. The first stands before Python's own, for what must be ours:
ROS's modules, the interfaces that come with holozen, and `msg`, `srv` and `action` of any package.
The second stands behind Python's, for packages known only from the folders around the script.
"""

import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

from holozen.console import report
from holozen.messages.definitions import ACTION_PARTS, InterfaceError
from holozen.messages.registry import KINDS, Places, Registry, tables
from holozen.packages import folders_above, local_packages
from holozen.ros import generated
from holozen.ros.catalog import HINTS, MESSAGES, MODULES, ONLY_INTERFACES, PAGE, PYPI, REEXPORTS
from holozen.suggest import closest, suggest

# of names that only interfaces have
_SUFFIXES = ("_msgs", "_srvs", "_interfaces", "_interface", "_msg", "_srv")
_TOP_LEVEL = {name.partition(".")[0] for name in MODULES}
_installed: list["_Front | _Back"] = []

Fill = Callable[[ModuleType], None]


def install(packages: Mapping[str, Path] = {}, near: Sequence[Path] = ()) -> None:
    """Make ROS's modules and interfaces importable in this process.

    `packages` are the folders of some packages (`--package NAME=DIR`); others are searched for
    around `near` (the script) and the working folder. A second call replaces the first.
    """
    remove()
    registry = Registry(packages, near)
    generated.use(registry)
    front, back = _Front(registry, near), _Back(registry, near)
    _installed.extend((front, back))
    sys.meta_path.insert(0, front)
    sys.meta_path.append(back)


def remove() -> None:
    """Undo `install`, and forget the modules that were imported."""
    if not _installed:
        return
    for finder in _installed:
        sys.meta_path.remove(finder)
    _installed.clear()
    generated.use(Registry())
    for name, module in list(sys.modules.items()):
        if isinstance(getattr(module, "__loader__", None), _Loader):
            del sys.modules[name]


def explain(error: ModuleNotFoundError, line: str) -> str:
    """Why the package that a line of source imports interfaces from was not found, or what to do
    about any other module that is missing; empty where the error names it itself.

    While Python looks for `my_pkg` it is not known that `my_pkg.srv` is wanted; this is clear only
    afterwards.
    """
    name = error.name or ""
    wants_interfaces = (
        re.search(rf"\b{re.escape(name)}\.(msg|srv|action)\b", line)
        if name.isidentifier()
        else None
    )
    if wants_interfaces and _installed:
        return _installed[0].unknown(name)
    if error.msg != f"No module named {name!r}" or "." in name:
        return ""
    if name in PYPI:
        return f"{error.msg}; install it: pip install {PYPI[name] or name}"
    near = suggest(name, _tops(name), alike=0.8)
    return f"{error.msg}{near}; of a package of yours give the folder: --package {name}=DIR"


class _Loader:
    """Loads one module by filling it. The base class of the standard library's loaders takes 20 ms
    to import.
    """

    def __init__(self, fill: Fill) -> None:
        self._fill = fill

    def create_module(self, _spec: ModuleSpec) -> None:
        """Let Python create it."""

    def exec_module(self, module: ModuleType) -> None:
        """Fill it."""
        self._fill(module)


class _Finder:
    def __init__(self, registry: Registry, near: Sequence[Path]) -> None:
        self.places, self._near = registry.places, near
        self.tables = {*tables()} - {"holozen"}  # which is a Python package as well
        self._told = set[str]()

    def interfaces(self, name: str) -> ModuleSpec:
        """The module `my_pkg.msg`, `my_pkg.srv` or `my_pkg.action`. Raises ModuleNotFoundError."""
        _check_exists(name)
        top, _, kind = name.partition(".")
        try:
            names = self.places.names(top)
            folder = self.places.folder(top) if top not in self.tables else None
        except ValueError as error:
            raise ModuleNotFoundError(str(error)) from None
        if any(each.startswith(f"{kind}/") for each in names):
            if top in ONLY_INTERFACES and top not in self._told:
                self._told.add(top)
                report(f"holozen run: {ONLY_INTERFACES[top]}")
            return _spec(name, _fill_interfaces(self.places))
        if folder or names:
            where = f" in {os.path.join(folder, kind)}" if folder else ""
            raise ModuleNotFoundError(f"package {top!r} has no .{kind} files{where}")
        raise ModuleNotFoundError(self.unknown(top), name=top)

    def unknown(self, name: str) -> str:
        """The error line for a package that is not found."""
        starts = [*map(Path, self._near), Path(os.path.abspath(os.curdir))]
        known = {
            *self.places.packages(),
            *(found for start in starts for found in local_packages(start)),
        }
        known -= {"holozen", name}  # one of that name may be without such files
        folders = list(
            dict.fromkeys(str(above[0]) for start in starts if (above := folders_above(start)))
        )
        return (
            f"no package {name!r} with .msg, .srv or .action files{suggest(name, known)}; "
            "searched AMENT_PREFIX_PATH,"
            " ROS_PACKAGE_PATH and the package.xml files around "
            f"{', '.join(folders) or 'no folder'};"
            f" to give its folder: --package {name}=DIR"
        )


class _Front(_Finder):
    """Finds what is ours, whatever else is on sys.path."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module to load; None if it is not ours."""
        top, _, rest = name.partition(".")
        if spec := self._single_type(name):
            return spec
        if name in MODULES:
            return _spec(name, _fill_library)
        if top in _TOP_LEVEL:
            module, _, last = name.rpartition(".")
            # Without `name=`, or Python would replace the message in `from rclpy import action`.
            raise ModuleNotFoundError(
                _missing_name(module, last, getattr(sys.modules[module], "__all__", []))
            )
        if top in self.tables and not rest:
            return _spec(name, _fill_package)
        if top in self.tables and rest in KINDS:
            return self.interfaces(name)
        if rest in KINDS:
            return self._beside_python(name, top)
        module = name.rpartition(".")[0]
        if top in self.tables or (module and _is_ours(module)):
            raise self._no_type(name)
        return None

    def _single_type(self, name: str) -> ModuleSpec | None:
        """The module of one type, such as `geometry_msgs.msg._twist`, if there is such a type."""
        module, _, last = name.rpartition(".")
        top, _, kind = module.partition(".")
        if kind not in KINDS or not last.startswith("_") or not _is_ours(module):
            return None
        suffixes = {
            "msg": ("",),
            "srv": ("", "_Request", "_Response"),
            "action": ("", *(f"_{part}" for part in ACTION_PARTS)),
        }[kind]
        for each in self.places.names(top):
            if each.startswith(f"{kind}/") and f"_{_snake_case(each.partition('/')[2])}" == last:
                return _spec(
                    name, _fill_single_type([f"{top}/{each}{suffix}" for suffix in suffixes])
                )
        return None

    def _beside_python(self, name: str, top: str) -> ModuleSpec | None:
        """The interfaces of a package whose Python modules may be found elsewhere. Those built by a
        real ROS are never used.
        """
        try:
            known = bool(self.places.names(top) or self.places.folder(top))
        except ValueError:
            known = True  # and `interfaces` reports what is wrong
        if not known and _is_file(getattr(sys.modules.get(top), "__spec__", None)):
            return None
        return self.interfaces(name)

    def _no_type(self, name: str) -> ImportError:
        top, _, last = name.rpartition(".")
        known = self.places.names(top) if "." not in top else []
        if kinds := [kind for kind in KINDS if f"{kind}/{last}" in known]:
            return ImportError(
                f"{top} has no {last}; write: from {top}.{kinds[0]} import {last}", name=name
            )
        if "." not in top and (near := closest(last, KINDS)):
            return ImportError(f"{top} has no {last!r}; write {top}.{near}", name=name)
        try:
            generated.find(name.replace(".", "/"))
        except InterfaceError as error:
            return ImportError(str(error), name=name)
        return ImportError(f"{name} is not a module", name=name)


class _Back(_Finder):
    """Finds packages that nothing else found."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The package `name` in the folders around the script: its Python modules, or its
        interfaces.
        """
        if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
            return None
        _check_exists(name)
        try:
            folder = self.places.folder(name)
            if folder and (spec := _python_package(name, folder)):
                return spec
            if folder and (self.places.names(name) or name.endswith(_SUFFIXES)):
                return _spec(name, _fill_package)
        except ValueError as error:
            raise ModuleNotFoundError(str(error), name=name) from None
        if name.endswith(_SUFFIXES):
            raise ModuleNotFoundError(self.unknown(name), name=name)
        return None


def _spec(name: str, fill: Fill) -> ModuleSpec:
    # Each is a package: then `from x import y` asks a finder for x.y, which can explain why there
    # is none.
    loader: Any = _Loader(fill)
    return ModuleSpec(name, loader, is_package=True)


def _python_package(name: str, folder: str) -> ModuleSpec | None:
    """The Python package of a ROS package, in its folder or in src."""
    spec = PathFinder.find_spec(name, [folder, os.path.join(folder, "src")])
    return spec if spec and _is_file(spec) and spec.submodule_search_locations else None


def _snake_case(name: str) -> str:
    """PointCloud2 as point_cloud2: the name of the file that ROS generates for a type."""
    parted = re.sub("(.)([A-Z][a-z]+)", r"\1_\2", name)
    return re.sub("([a-z0-9])([A-Z])", r"\1_\2", parted).lower()


def _is_ours(module: str) -> bool:
    """Whether an imported module was loaded by a finder of this file."""
    return isinstance(getattr(sys.modules.get(module), "__loader__", None), _Loader)


def _is_file(spec: ModuleSpec | None) -> bool:
    """Whether a spec is of a file, and not only of a folder with that name."""
    return spec is not None and spec.origin is not None


def _check_exists(name: str) -> None:
    """Raises ModuleNotFoundError for a module that does not exist here, with what to use
    instead.
    """
    if name in HINTS:
        raise ModuleNotFoundError(
            f"there is no {name!r} here; {HINTS[name]}; see {PAGE}", name=name
        )


def _missing_name(module: str, name: str, known: Sequence[str]) -> str:
    """The error line for a name that a module of ROS does not have here."""
    full = f"{module}.{name}"
    if full in HINTS:
        hint = f"; {HINTS[full]}"
    elif place := next(
        filter(None, (_defined_in(name, top) for top in _tops(module.partition(".")[0]))), ""
    ):
        hint = f"; it is in {place}"
    else:
        below = (each for each in MODULES if each.startswith(f"{module}."))
        hint = suggest(name, [*known, *below], lambda each: each.rpartition(".")[2])
    return f"{module} has no {name!r} here{hint}; see {PAGE}"


def _tops(name: str) -> list[str]:
    """The top-level packages of ROS: `name` first, then those with the same first word."""
    tops = dict.fromkeys(module.partition(".")[0] for module in MODULES)
    return sorted(
        tops, key=lambda top: (top != name, top.partition("_")[0] != name.partition("_")[0])
    )


def _defined_in(name: str, top: str) -> str:
    """The module of a top-level package of ROS that has this name; empty if none has. launch_ros
    has modules only.
    """
    found = [
        module
        for module, ours in MODULES.items()
        if module.partition(".")[0] == top
        and name in import_module(ours).__all__
        and module != "launch_ros"
    ]
    return next(
        (module for module in found if module.endswith(f".{_snake_case(name)}")), "".join(found[:1])
    )


def _fill_library(module: ModuleType) -> None:
    """Fill a module of ROS with what ours lists in `__all__`."""
    name = module.__name__
    ours = import_module(MODULES[name])
    getattr(
        ours, "for_scripts", lambda: None
    )()  # what a module needs only where a script imports it
    for each in ours.__all__:
        value = module.__dict__[each] = getattr(ours, each)
        if (
            isinstance(value, type)
            and issubclass(value, BaseException)
            and value.__module__.startswith("holozen.")
        ):
            value.__module__ = name  # tracebacks show it
    others = REEXPORTS.get(name, ())

    def get(wanted: str) -> Any:
        if wanted in others:
            messages = (place for place, names in MESSAGES.items() if wanted in names)
            value = getattr(
                import_module(next(messages, "") or _defined_in(wanted, "rclpy")), wanted
            )
            return module.__dict__.setdefault(wanted, value)
        if f"{name}.{wanted}" in MODULES:
            return import_module(f"{name}.{wanted}")
        if wanted.startswith("__"):  # tools that inspect all modules ask for these
            raise AttributeError(f"{name} has no {wanted!r}")
        raise AttributeError(_missing_name(name, wanted, ours.__all__))

    _finish(module, ours.__doc__ or "", [*ours.__all__, *others], get)


def _fill_package(module: ModuleType) -> None:
    """Fill a package of interfaces, such as geometry_msgs."""
    name = module.__name__

    def get(wanted: str) -> Any:
        if wanted in KINDS:
            try:
                return import_module(f"{name}.{wanted}")
            except ImportError as error:
                raise AttributeError(str(error)) from None
        raise AttributeError(f"{name} has no {wanted!r}; it has msg, srv and action")

    _finish(module, f"The interfaces of {name}.", [], get)


def _fill_interfaces(places: Places) -> Fill:
    """For a module such as geometry_msgs.msg, whose classes are generated on first use."""

    def fill(module: ModuleType) -> None:
        top, _, kind = module.__name__.partition(".")

        def get(wanted: str) -> Any:
            if wanted.startswith("_"):
                raise AttributeError(f"{module.__name__} has no {wanted!r}")
            try:
                made = module.__dict__[wanted] = generated.find(f"{top}/{kind}/{wanted}")
            except InterfaceError as error:
                # A file that exists and is wrong must not make `hasattr` false.
                exists = f"{kind}/{wanted}" in places.names(top)
                raise (ImportError if exists else AttributeError)(str(error)) from None
            return made

        names = [
            name.partition("/")[2] for name in places.names(top) if name.startswith(f"{kind}/")
        ]
        _finish(module, f"The {kind} interfaces of {top}.", names, get)

    return fill


def _fill_single_type(names: list[str]) -> Fill:
    """For a module such as geometry_msgs.msg._twist, which ROS has for each class; editors write
    such imports.
    """

    def fill(module: ModuleType) -> None:
        found = {name.rpartition("/")[2]: generated.find(name) for name in names}
        module.__dict__.update(found)

        def get(wanted: str) -> Any:
            raise AttributeError(f"{module.__name__} has no {wanted!r}; it has {', '.join(found)}")

        _finish(module, f"{', '.join(names)}.", [*found], get)

    return fill


def _finish(module: ModuleType, doc: str, names: list[str], get: Callable[[str], Any]) -> None:
    module.__dict__.update(
        {
            "__doc__": doc,
            "__all__": names,
            "__getattr__": get,
            "__dir__": lambda: sorted({*module.__dict__, *names}),
        }
    )
