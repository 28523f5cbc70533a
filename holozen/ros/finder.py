"""Finds ROS's modules and interface packages when a script of this process imports them.

One finder stands before Python's own, for what must be ours. The other stands behind them, for the packages that only
the script's own folders know: a Python package on sys.path goes first, and then only its `msg` and `srv` are ours.
"""

import os
import re
import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

from holozen.interfaces import InterfaceError, Registry
from holozen.interfaces.places import tables
from holozen.interfaces.registry import closest
from holozen.ros import generated, missing, modules
from holozen.ros.table import MODULES

KINDS = ("msg", "srv")
_ENDS = ("_msgs", "_srvs", "_interfaces", "_interface", "_msg", "_srv")  # names that only interfaces have
_TOPS = {name.partition(".")[0] for name in MODULES}
_DEPTH = 30  # frames between an import and its finder; there are some ten
_installed: list["_Front | _Back"] = []


def install(packages: Mapping[str, Path] = {}, near: Sequence[Path] = ()) -> None:
    """Make ROS's modules and interfaces importable in this process.

    `packages` are the folders of some packages (`--package NAME=DIR`); others are looked up around `near` (the script)
    and the working folder. A second call takes the place of the first.
    """
    remove()
    registry = Registry(packages, near)
    generated.use(registry)
    front, back = _Front(registry, near), _Back(registry, near)
    _installed.extend((front, back))
    sys.meta_path.insert(0, front)
    sys.meta_path.append(back)


def remove() -> None:
    """Undo `install`; the modules that were imported are forgotten."""
    for finder in _installed:
        sys.meta_path.remove(finder)
    _installed.clear()
    generated.use(Registry())
    for name, module in list(sys.modules.items()):
        if isinstance(getattr(module, "__loader__", None), _Maker):
            del sys.modules[name]


class _Maker:
    """Makes one module. The base class of the standard library's loaders takes 20 ms to import."""

    def __init__(self, fill: modules.Fill) -> None:
        self._fill = fill

    def create_module(self, _spec: ModuleSpec) -> None:
        """Python makes it."""

    def exec_module(self, module: ModuleType) -> None:
        """Fill it."""
        self._fill(module)


def _spec(name: str, fill: modules.Fill) -> ModuleSpec:
    # Each is a package: then `from x import y` asks a finder for x.y, which can say why there is none.
    maker: Any = _Maker(fill)
    return ModuleSpec(name, maker, is_package=True)


class _Finder:
    def __init__(self, registry: Registry, near: Sequence[Path]) -> None:
        self.places, self._near = registry.places, near
        self.tables = {*tables()} - {"holozen"}  # that one is a package of Python's too

    def kind(self, name: str) -> ModuleSpec:
        """The module of `my_pkg.msg` or `my_pkg.srv`. Raises ModuleNotFoundError."""
        top, _, kind = name.partition(".")
        try:
            names = self.places.names(top)
            folder = self.places.folder(top) if top not in self.tables else None
        except ValueError as error:
            raise ModuleNotFoundError(str(error)) from None
        if kind == "action":
            raise ModuleNotFoundError(f"{name}: {missing.ACTIONS}; see {missing.PAGE}")
        if any(each.startswith(f"{kind}/") for each in names):
            return _spec(name, modules.interfaces(self.places))
        if folder or names:
            where = f" in {os.path.join(folder, kind)}" if folder else ""
            raise ModuleNotFoundError(f"package {top!r} has no .{kind} files{where}")
        raise ModuleNotFoundError(self.unknown(top), name=top)

    def unknown(self, name: str) -> str:
        """The line for a package that is not found."""
        from holozen.robot.packages import folders_above, local_packages

        starts = [*map(Path, self._near), Path(os.path.abspath(os.curdir))]
        known = {*self.places.packages(), *(found for start in starts for found in local_packages(start))} - {"holozen"}
        folders = list(dict.fromkeys(str(above[0]) for start in starts if (above := folders_above(start))))
        return (
            f"no package {name!r} with .msg or .srv files{closest(name, known)}; looked in AMENT_PREFIX_PATH,"
            f" ROS_PACKAGE_PATH and for its package.xml around {', '.join(folders) or 'no folder'};"
            f" say where it is: --package {name}=DIR"
        )


class _Front(_Finder):
    """What is ours, whatever else is on sys.path: ROS's modules, our tables, and `msg` and `srv` of any package."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The module to make; None if it is somebody else's."""
        top, _, rest = name.partition(".")
        if spec := self._of_one(name):
            return spec
        if name in MODULES:
            return _spec(name, modules.library)
        if top in _TOPS:
            module, _, last = name.rpartition(".")
            # Without its name Python tells it: one with the name is lost in `from rclpy import action`.
            raise ModuleNotFoundError(missing.in_module(module, last, getattr(sys.modules[module], "__all__", [])))
        if top in self.tables:
            return self._ours(name, rest)
        if rest in (*KINDS, "action"):
            return self._beside(name, top)
        module = name.rpartition(".")[0]
        if module and _is_made(module):
            raise self._no_type(name)
        return None

    def _of_one(self, name: str) -> ModuleSpec | None:
        """The module of `geometry_msgs.msg._twist`, where that is a type."""
        module, _, last = name.rpartition(".")
        top, _, kind = module.partition(".")
        if kind not in KINDS or not last.startswith("_") or not _is_made(module):
            return None
        ends = ("", "_Request", "_Response") if kind == "srv" else ("",)
        for each in self.places.names(top):
            if each.startswith(f"{kind}/") and f"_{_snake(each.partition('/')[2])}" == last:
                return _spec(name, modules.of_one([f"{top}/{each}{end}" for end in ends]))
        return None

    def _ours(self, name: str, rest: str) -> ModuleSpec:
        if not rest:
            return _spec(name, modules.package)
        if rest in (*KINDS, "action"):
            return self.kind(name)
        raise self._no_type(name)

    def _beside(self, name: str, top: str) -> ModuleSpec | None:
        """The interfaces of a package whose Python modules may be another's. Those that a real ROS made are no use."""
        try:
            known = bool(self.places.names(top) or self.places.folder(top))
        except ValueError:
            known = True  # and `kind` tells what is wrong
        if not known and _is_real(getattr(sys.modules.get(top), "__spec__", None)):
            return None
        return self.kind(name)

    def _no_type(self, name: str) -> ImportError:
        top, _, last = name.rpartition(".")
        known = self.places.names(top) if "." not in top else []
        if kinds := [kind for kind in KINDS if f"{kind}/{last}" in known]:
            return ImportError(f"{top} has no {last}; write: from {top}.{kinds[0]} import {last}", name=name)
        try:
            generated.find(name.replace(".", "/"))
        except InterfaceError as error:
            return ImportError(str(error), name=name)
        return ImportError(f"{name} is no module", name=name)


class _Back(_Finder):
    """Packages that nothing else found."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The package `name` of the folders around the script, its Python modules or its interfaces."""
        if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
            return None
        if name in missing.HINTS:
            raise ModuleNotFoundError(
                f"there is no {name!r} here; {missing.HINTS[name]}; see {missing.PAGE}", name=name
            )
        asked = _asked(name)
        is_ros = asked.removeprefix(f"{name}.") in (*KINDS, "action") or name.endswith(_ENDS)
        try:
            folder = self.places.folder(name)
            if folder and (spec := _python(name, folder)):
                return spec
            if folder and (is_ros or self.places.names(name)):
                return _spec(name, modules.package)
        except ValueError as error:
            raise ModuleNotFoundError(str(error), name=name) from None
        if is_ros:
            raise ModuleNotFoundError(self.unknown(name), name=name)
        return None


def _python(name: str, folder: str) -> ModuleSpec | None:
    """The Python package of a ROS package, which lies in its folder or in src."""
    spec = PathFinder.find_spec(name, [folder, os.path.join(folder, "src")])
    return spec if spec and _is_real(spec) and spec.submodule_search_locations else None


def _snake(name: str) -> str:
    """PointCloud2 as point_cloud2, the name of the file that ROS makes for a type."""
    parted = re.sub("(.)([A-Z][a-z]+)", r"\1_\2", name)
    return re.sub("([a-z0-9])([A-Z])", r"\1_\2", parted).lower()


def _is_made(module: str) -> bool:
    """Whether a module that was imported is one of a finder here."""
    return isinstance(getattr(sys.modules.get(module), "__loader__", None), _Maker)


def _is_real(spec: ModuleSpec | None) -> bool:
    """Whether a spec is of a file, and not only of a folder with this name."""
    return spec is not None and spec.origin is not None


def _asked(name: str) -> str:
    """The whole name of the import under way: for `my_pkg.srv`, Python finds `my_pkg` first and does not say why.

    Read off the import's own frames, and only to tell a better error; where they look otherwise, it is `name`.
    """
    frame = sys._getframe(1)
    for _ in range(_DEPTH):
        whole = frame.f_locals.get("name")
        if "importlib" in frame.f_code.co_filename and isinstance(whole, str) and whole.startswith(f"{name}."):
            return whole
        if frame.f_back is None:
            break
        frame = frame.f_back
    return name
