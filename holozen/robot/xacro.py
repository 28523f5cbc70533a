"""xacro without ROS: the xacro library, with `$(find)` answered by our own package lookup."""

import re
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.parsers.expat import ErrorString, ExpatError

from holozen.robot.errors import RobotError
from holozen.robot.packages import find_named, find_package

_ONE_AT_A_TIME = threading.Lock()  # the library keeps its state in module globals
_XACRO_ELEMENT = re.compile(r"<xacro:\w")


def expand(path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}) -> str:
    """The URDF text of a robot file, as the xacro library prints it; a file without xacro is not changed.

    `args` are the values of `xacro:arg`, `packages` the folders of `--package NAME=DIR`. The file is trusted:
    xacro evaluates Python expressions and reads files, so never expand what came over the wire.

    Raises RobotError with the file, the line where xacro knows it, and the chain of macros and includes.
    """
    text = read_text(path)
    return _expanded(path, args, packages) if is_xacro(path, text) else text


def read_text(path: Path) -> str:
    """The text of a file, line ends kept. Raises RobotError when it cannot be read or is not UTF-8."""
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RobotError(f"{path}: byte {error.start} is not UTF-8 text; save the file as UTF-8") from None
    except (OSError, ValueError) as error:
        raise RobotError(f"{path}: {getattr(error, 'strerror', None) or error}") from None


def is_xacro(path: Path, text: str) -> bool:
    """Whether a robot file has to be expanded: by its name, or since it has xacro elements all the same."""
    return path.name.endswith(".xacro") or _XACRO_ELEMENT.search(text) is not None


def _expanded(path: Path, args: Mapping[str, str], packages: Mapping[str, Path]) -> str:
    xacro = _library()
    guesses: dict[str, Path] = {}

    def find(name: str) -> str:
        package = find_package(name, path, packages)
        if find_named(name, path, packages) is None:
            guesses[name] = package
        return str(package)

    with _ONE_AT_A_TIME, _finding_with(find):
        try:
            document = xacro.process_file(str(path), mappings=dict(args))
            return str(document.toprettyxml(indent="  "))
        except Exception as error:  # the library raises whatever an expression in the file raises
            raise RobotError(_told(path, xacro, error, guesses)) from None


def _library() -> Any:
    try:
        import xacro
    except ImportError:
        raise RobotError("the xacro library is missing; install it with: pip install xacro") from None
    return xacro


@contextmanager
def _finding_with(find: Callable[[str], str]) -> Iterator[None]:
    """Within this block `$(find NAME)` calls `find`; the library would ask ROS's package index."""
    from xacro import substitution_args as library

    kept, library._eval_find = library._eval_find, find
    try:
        yield
    finally:
        library._eval_find = kept


def _told(path: Path, xacro: Any, error: Exception, guesses: Mapping[str, Path]) -> str:
    cause, suffix = _cause(error)
    if isinstance(cause, RobotError):
        return f"{cause}{_chain(xacro)}"
    line = f", line {cause.lineno}" if isinstance(cause, ExpatError) else ""
    hint = _guessed(guesses) if isinstance(cause, OSError) else ""
    file = [path, *xacro.filestack][-1]  # the stack is empty when not even the first file could be opened
    return f"{file}{line}: {_reason(cause, suffix)}{_chain(xacro)}{hint}"


def _reason(cause: Exception, suffix: str) -> str:
    if isinstance(cause, ExpatError):
        return f"broken XML: {ErrorString(cause.code)}"
    if isinstance(cause, OSError):
        return f"{cause.strerror}: {cause.filename}"
    if isinstance(cause, RecursionError):
        return "a macro, a property or an include calls itself without end, or elements are nested too deep"
    if type(cause).__name__ == "ArgException":
        return f"$(arg {cause}) has no value; give one with {cause}:=VALUE or a default in <xacro:arg>"
    told = str(cause) if not isinstance(cause, KeyError) else f"there is no {cause}"
    return " ".join(f"{told or type(cause).__name__} {suffix}".split())


def _cause(error: Any) -> tuple[Exception, str]:
    """The innermost of the library's wrapped errors, and the innermost "when evaluating ..." on the way."""
    suffix = ""
    while isinstance(getattr(error, "exc", None), Exception):
        suffix = getattr(error, "suffix", None) or suffix
        error = error.exc
    return error, suffix


def _chain(xacro: Any, most: int = 6) -> str:
    # The stacks still stand as they were when the error was raised.
    macros = [f"in macro {macro.body.getAttribute('name')!r} of {macro.history[-1][-1]}" for macro in xacro.macrostack]
    files = [f"included from {file}" for file in xacro.filestack[:-1]]
    chain = [*reversed(macros), *reversed(files)]
    cut = [f"and {len(chain) - most} more"] if len(chain) > most else []
    return f" ({', '.join([*chain[:most], *cut])})" if chain else ""


def _guessed(guesses: Mapping[str, Path]) -> str:
    """A hint for each package that nothing but the place of the robot file spoke for."""
    return "".join(
        f"; no package.xml says {name!r}, so {folder} was taken for it: if wrong, give --package {name}=DIR"
        for name, folder in guesses.items()
    )
