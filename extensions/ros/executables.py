"""What `holozen run` runs: a Python file, or an executable of a package.

The console scripts of a Python package are read from setup.cfg and setup.py, without running
either.
"""

import ast
import configparser
import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from holozen.console import Failure
from holozen.robot.errors import RobotError
from holozen.ros import cmake, packages
from holozen.suggest import listed, suggest

# where scripts lie in a package's sources
FOLDERS = ("scripts", "{package}", "nodes", "src", "bin")
_HEAD = 200  # bytes of a file that show whether it is a script


class NotFound(Failure, ValueError):
    """There is no such file, package or executable, or it is not a Python script. One line that
    lists what there is.
    """


class PackageNotFound(NotFound):
    """There is no such package."""


class NotPython(NotFound):
    """There is such a file, but it is not a Python script."""


class Script(Struct, frozen=True):
    """A Python file, run as `__main__`; or `function` of `module`, if that is not empty.

    `root` is the first folder in which its imports are looked up.
    """

    path: Path
    root: Path
    module: str = ""
    function: str = ""


def from_file(path: Path) -> Script:
    """A Python file. Raises NotFound."""
    if path.is_dir():
        raise NotFound(f"{path} is a folder; give a Python file, or PACKAGE EXECUTABLE")
    if not path.exists():
        raise NotFound(missing(path, "*.py", "Python files"))
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise NotFound(f"cannot read {path}: {error.strerror}") from None
    if path.suffix != ".py" and not _is_python(head):
        raise NotPython(
            f"{path} is not a Python script: its name must end with .py, or it must begin "
            "#!/usr/bin/python3"
        )
    path = path.absolute()
    return Script(path, path.resolve().parent)


def missing(path: Path, pattern: str, what: str) -> str:
    """The error line about a file that does not exist, with the most similar one in its folder, or
    all.
    """
    files = sorted(each.name for each in path.parent.glob(pattern) if each.is_file())
    if not files:
        return f"{path} does not exist, and there are no {what} in that folder"
    near = suggest(path.name, files, lambda name: name.partition(".")[0])
    return f"{path} does not exist{near or f'; {what} in that folder: {listed(files, 20)}'}"


def find(package: str, name: str, nameless: bool = False) -> Script:
    """The executable `name` of a package, with or without `.py`. Raises NotFound.

    If `nameless`, a folder without a package.xml is accepted too if it contains the executable.
    """
    try:
        return _found(_folder(package, nameless=False), package, name)
    except PackageNotFound:
        with contextlib.suppress(NotFound):
            if nameless:
                return _found(_folder(package, nameless=True), package, name)
        raise


def _found(folder: Path, package: str, name: str) -> Script:
    declared = console_scripts(folder)
    if name in declared:
        return _console_script(folder, declared[name], name)
    files = dict(_files(folder, package))
    for wanted in (name, f"{name}.py"):
        if wanted in files:
            return from_file(files[wanted])
    known = sorted({*declared, *files})
    fault = (
        f"package {package!r} has no executable {name!r}{suggest(name, known)}"
        if name
        else "give an executable"
    )
    raise NotFound(f"{fault}; executables in {folder}: {listed(known, 20)}")


def names(package: str) -> list[str]:
    """The executables of a package. Raises NotFound."""
    folder = _folder(package, nameless=False)
    return sorted({*console_scripts(folder), *(name for name, _ in _files(folder, package))})


def _folder(package: str, nameless: bool) -> Path:
    try:
        return packages.find(package, nameless)
    except RobotError as error:
        raise PackageNotFound(str(error)) from None


def _files(folder: Path, package: str) -> Iterator[tuple[str, Path]]:
    """Name and path of everything that can be run, in reverse order of precedence."""
    yield from _in_setup_py(folder)
    prefix = packages.prefix(folder)
    for each in (
        *(folder / part.format(package=package) for part in reversed(FOLDERS)),
        prefix / "lib" / package,
    ):
        try:
            names = sorted(os.listdir(each))
        except OSError:
            continue
        for name in names:
            path = each / name
            runs = name.endswith(".py") or (os.access(path, os.X_OK) and "." not in name)
            if path.is_file() and runs and not name.startswith("__"):
                yield name, path
    for name, path in cmake.programs(folder).items():
        if path.suffix in ("", ".py"):
            yield name, path


def _in_setup_py(folder: Path) -> Iterator[tuple[str, Path]]:
    """The scripts that setup.py names by their files, such as scripts=["tools/drive.py"]."""
    for node in ast.walk(_parsed(folder / "setup.py")):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and node.value.endswith(".py")
        ):
            path = folder / node.value
            if path.is_file() and path.resolve().is_relative_to(folder.resolve()):
                yield path.name, path


def _console_script(folder: Path, place: str, name: str) -> Script:
    module, _, function = place.partition(":")
    stem = folder.joinpath(*module.split("."))
    for path in (stem.with_name(f"{stem.name}.py"), stem / "__init__.py"):
        if path.is_file():
            return Script(path.absolute(), folder.absolute(), module, function)
    raise NotFound(
        f"{folder}: executable {name!r} is {place} in its setup file, but {stem}.py does not exist"
    )


def _is_python(head: bytes) -> bool:
    first = head.splitlines()[0] if head else b""
    return b"\0" not in head and first.startswith(b"#!") and b"python" in first


def console_scripts(folder: Path) -> dict[str, str]:
    """Command -> `module:function` of the console scripts that the package in `folder` declares.
    Raises NotFound.
    """
    lines = [*_from_setup_cfg(folder / "setup.cfg"), *_from_setup_py(folder / "setup.py")]
    found = {}
    for line in lines:
        name, _, place = line.partition("=")
        module, _, function = place.partition("[")[0].partition(":")
        if name.strip() and module.strip():
            found[name.strip()] = f"{module.strip()}:{function.strip() or 'main'}"
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig") if path.is_file() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise NotFound(
            f"cannot read {path}: {getattr(error, 'strerror', '') or 'it is not UTF-8'}"
        ) from None


def _from_setup_cfg(path: Path) -> list[str]:
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(_text(path))
    except configparser.Error as error:
        raise NotFound(f"{path}: {' '.join(str(error).split())}") from None
    return parser.get("options.entry_points", "console_scripts", fallback="").splitlines()


def _parsed(path: Path) -> ast.Module:
    try:
        return ast.parse(_text(path))
    except (SyntaxError, ValueError, RecursionError) as error:
        line = getattr(error, "lineno", None) or 1
        raise NotFound(f"{path}:{line}: {getattr(error, 'msg', error)}") from None


def _from_setup_py(path: Path) -> list[str]:
    tree = _parsed(path)
    names = _constants(tree)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant) and key.value == "console_scripts":
                    elements = value.elts if isinstance(value, ast.List | ast.Tuple) else [value]
                    found += [
                        line
                        for element in elements
                        for line in _string(element, names).splitlines()
                    ]
    return found


def _constants(tree: ast.Module) -> dict[str, str]:
    """The string constants of a file, such as `package_name = "my_bot"`."""
    names: dict[str, str] = {}
    for node in tree.body:
        if (
            isinstance(node, ast.Assign)
            and len(node.targets) == 1
            and isinstance(node.targets[0], ast.Name)
        ):
            names[node.targets[0].id] = _string(node.value, names)
    return names


def _string(node: ast.expr, names: dict[str, str]) -> str:
    """The value of an expression of string constants; empty for any other."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.Name(id=name):
            return names.get(name, "")
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _string(left, names) + _string(right, names)
        case ast.JoinedStr(values=parts):
            return "".join(_string(part, names) for part in parts)
        case ast.FormattedValue(value=value):
            return _string(value, names)
    return ""
