"""xacro without ROS: the xacro library in a process of its own, with `$(find)` answered by our own package lookup."""

import json
import os
import re
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.robot.tag import check_size
from holozen.robot.xacro.inputs import Outcome, unchanged
from holozen.tell import say

_XACRO_ELEMENT = re.compile(r"<xacro:\w")
_FORMAT = 1  # of a cache entry


def expand(path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}) -> str:
    """The URDF text of a robot file; a file without xacro is not changed. Otherwise as `expand_xacro`."""
    text = read_text(path)
    return expand_xacro(path, args, packages) if is_xacro(path, text) else text


def expand_xacro(path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}) -> str:
    """The text that the xacro library makes of a file: what its own command line prints, and
    `process_file(path).toprettyxml(indent="  ")`, byte for byte.

    `args` are the values of `xacro:arg`, `packages` the folders of `--package NAME=DIR`. The file is trusted: xacro
    evaluates Python expressions and reads files, so never expand what came over the wire. The library's warnings are
    said. Raises RobotError with the file, the line, and the chain of macros and includes.
    """
    outcome = process(path, args, packages)
    if outcome.error:
        raise RobotError(outcome.error)
    for warning in outcome.warnings:
        say(warning)
    return outcome.text


def process(path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}) -> Outcome:
    """As `expand_xacro`, with what the text was made from. An earlier text is used while none of that changed.

    Raises RobotError only where the file was not even given to the library.
    """
    from holozen.robot.xacro import cache

    read_text(path)
    key = _key(path, args, packages)
    entry = cache.load(key)
    if entry and unchanged(entry["inputs"], path, packages):
        return Outcome(entry["text"], "", entry["inputs"], tuple(entry["warnings"]), True)
    from holozen.robot.xacro.run import run

    outcome = run(path, args, packages)
    if outcome.pure and not outcome.error:
        cache.store(key, asdict(outcome))
    return outcome


def read_text(path: Path) -> str:
    """The text of a file, line ends kept. Raises RobotError when it cannot be read, is too large or is not UTF-8."""
    try:
        if path.is_file():
            check_size(path.stat().st_size, str(path))
        elif path.exists() and not path.is_dir():
            raise RobotError(f"{path}: this is no file; give one that can be read more than once")
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RobotError(f"{path}: byte {error.start} is not UTF-8 text; save the file as UTF-8") from None
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror or error}") from None
    except RobotError:
        raise
    except ValueError as error:
        raise RobotError(f"{path}: {error}") from None
    return text


def is_xacro(path: Path, text: str) -> bool:
    """Whether a robot file has to be expanded: by its name, or since it has xacro elements all the same."""
    return path.name.endswith(".xacro") or _XACRO_ELEMENT.search(text) is not None


def _key(path: Path, args: Mapping[str, str], packages: Mapping[str, Path]) -> str:
    """All that makes a text besides its inputs, as text. The working folder is the start of relative names."""
    given = {name: str(folder) for name, folder in packages.items()}
    return json.dumps([_FORMAT, str(path), _here(), dict(args), given, sys.version, _code()], sort_keys=True)


def _here() -> str:
    try:
        return os.getcwd()
    except OSError:
        return ""


def _code() -> list[tuple[str, int, int]]:
    """The files of the library and of our own part in it; installing another version changes them."""
    here = Path(__file__).parent
    files = [*_library().glob("*.py"), *here.glob("*.py"), here.parent / "packages.py"]
    stats = [(str(file), file.stat()) for file in files]
    return sorted((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats)


def _library() -> Path:
    from importlib.util import find_spec

    found = find_spec("xacro")
    if found is None or found.origin is None:
        raise RobotError("the xacro library is missing; install it with: pip install xacro")
    return Path(found.origin).parent
