"""The console scripts that a Python package declares, read from setup.cfg and setup.py; nothing of it is run."""

import ast
import configparser
from pathlib import Path

Declared = dict[str, str]
"""A command's name -> `module:function`."""


class SetupError(ValueError):
    """A setup file cannot be read. One line."""


def declared(folder: Path) -> Declared:
    """The console scripts of the package in `folder`. Raises SetupError."""
    lines = [*_of_cfg(folder / "setup.cfg"), *_of_py(folder / "setup.py")]
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
        raise SetupError(f"{path}: cannot be read: {getattr(error, 'strerror', '') or 'it is not UTF-8'}") from None


def _of_cfg(path: Path) -> list[str]:
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(_text(path))
    except configparser.Error as error:
        raise SetupError(f"{path}: {' '.join(str(error).split())}") from None
    return parser.get("options.entry_points", "console_scripts", fallback="").splitlines()


def _of_py(path: Path) -> list[str]:
    try:
        tree = ast.parse(_text(path))
    except (SyntaxError, ValueError, RecursionError) as error:
        line = getattr(error, "lineno", None) or 1
        raise SetupError(f"{path}:{line}: {getattr(error, 'msg', error)}") from None
    names = _constants(tree)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant) and key.value == "console_scripts":
                    elements = value.elts if isinstance(value, ast.List | ast.Tuple) else [value]
                    found += [line for element in elements for line in _string(element, names).splitlines()]
    return found


def _constants(tree: ast.Module) -> dict[str, str]:
    """The texts that the file's names stand for, such as `package_name = "my_bot"`."""
    names: dict[str, str] = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            names[node.targets[0].id] = _string(node.value, names)
    return names


def _string(node: ast.expr, names: dict[str, str]) -> str:
    """The text of an expression of texts; empty for any other."""
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
