"""Xacro without ROS: runs the xacro library in a process of its own, and caches texts until their
inputs change.
"""

import contextlib
import glob
import hashlib
import json
import os
import pickle
import re
import signal
import stat
import subprocess
import sys
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any
from xml.parsers.expat import ExpatError, ParserCreate

import msgspec
from msgspec import Struct
from msgspec.structs import asdict, replace

from holozen.console import report
from holozen.packages import find_package
from holozen.robot.errors import RobotError
from holozen.robot.files import reader
from holozen.robot.files.elements import MAX_TEXT, read_text, read_xml, repair_xml
from holozen.robot.files.uris import VARIABLES
from holozen.suggest import cut, listed, suggest
from holozen.system import memory_file

# What to expand; and the result, with its inputs: files, wildcards, environment variables and
# packages.


class XacroFile(Struct, frozen=True):
    """A xacro file, the values of its `xacro:arg`, the folders of `--package NAME=DIR`, and the
    environment variables that it may read.
    """

    path: Path
    args: Mapping[str, str] = {}
    packages: Mapping[str, Path] = {}
    allow_env: Collection[str] = ()


Answer = str | list[str] | None
Inputs = dict[str, dict[str, Answer]]
"""Kind ("file", "glob", "env", "find") -> input -> its value during the expansion."""


class Outcome(Struct, frozen=True):
    """The result of an expansion: a text, or a one-line error.

    `inputs` are those that it read. `pure` means that the text depends on nothing else.
    """

    text: str = ""
    error: str = ""
    inputs: Inputs = {}
    warnings: tuple[str, ...] = ()
    pure: bool = False


def answer(kind: str, asked: str, start: Path, packages: Mapping[str, Path]) -> Answer:
    """The current value of `asked`; None for a missing file, variable or package."""
    if kind == "file":
        return digest(asked)
    if kind == "glob":
        return sorted(glob.glob(asked))
    if kind == "env":
        return os.environ.get(asked)
    try:
        return str(find_package(asked, start, packages))
    except RobotError:
        return None


def digest(path: str) -> str | None:
    """A file is identified by its content: two saves within a clock tick may leave size and times
    unchanged.
    """
    try:
        state = os.stat(path)
        if not stat.S_ISREG(state.st_mode) or state.st_size > MAX_TEXT:
            return (
                f"{state.st_mode} {state.st_size} {state.st_mtime_ns}"  # nothing that is expanded
            )
        with open(path, "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()
    except (OSError, ValueError):
        return None


def current(inputs: Inputs, start: Path, packages: Mapping[str, Path]) -> Inputs:
    """The same inputs with their current values."""
    return {
        kind: {asked: answer(kind, asked, start, packages) for asked in answers}
        for kind, answers in inputs.items()
    }


def unasked(path: Path, given: Collection[str], asked: Collection[str] = ()) -> tuple[str, ...]:
    """A warning for each argument that is `given` to a file and not among those that it has `asked`
    for. Xacro ignores them, so that a misspelt one would be the default.
    """
    left = sorted(set(asked).difference(given))
    return tuple(
        f"{path}: there is no argument {cut(name)}{suggest(name, left)}; its arguments are: "
        f"{listed(asked)}"
        for name in given
        if name not in asked
    )


# Expanded texts in the user's cache folder, each with its inputs. Damaged entries, and those of
# other users, are ignored, and so is a folder that cannot be written.


MAX_ENTRIES = 64
MAX_BYTES = 1_000_000  # per entry


def cache_folder() -> Path | None:
    """`holozen/xacro` in $XDG_CACHE_HOME or ~/.cache; None if neither is an absolute path."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    home = given if os.path.isabs(given) else os.path.join(os.path.expanduser("~"), ".cache")
    return Path(home, "holozen", "xacro") if os.path.isabs(home) else None


def load_cached(key: str) -> dict[str, Any] | None:
    """The entry stored under `key`, if it is complete and this user's; else None."""
    try:
        path = _cache_path(key)
        with open(path, "rb") as file:
            mine = os.fstat(file.fileno()).st_uid == os.getuid()
            head, _, body = file.read(2 * MAX_BYTES).partition(b"\n")
        if not mine or head != _checksum(body):
            return None
        entry = json.loads(body)
        return entry if entry["key"] == key else None
    except (OSError, ValueError):
        return None


def store_cached(key: str, entry: dict[str, Any]) -> None:
    """Store an entry atomically; then delete the oldest beyond MAX_ENTRIES."""
    body = json.dumps(entry | {"key": key}).encode()
    if len(body) > MAX_BYTES:
        return
    with contextlib.suppress(OSError, ValueError):
        path = _cache_path(key)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        part = path.with_suffix(f".{os.getpid()}.part")
        try:
            part.write_bytes(_checksum(body) + b"\n" + body)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        _evict(path.parent)


def _cache_path(key: str) -> Path:
    folder = cache_folder()
    if folder is None:
        raise OSError("no cache folder")
    return (
        folder / f"{hashlib.sha256(key.encode('utf-8', 'surrogateescape')).hexdigest()[:32]}.json"
    )


def _checksum(body: bytes) -> bytes:
    return hashlib.sha256(body).hexdigest().encode()


def _evict(folder: Path) -> None:
    # also temporary files of killed processes
    by_age = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    for path in by_age[:-MAX_ENTRIES]:
        path.unlink(missing_ok=True)


# The process.


PROCESSOR_TIME = 6  # s for a whole expansion; the largest robots take 2
# s of CPU time for one expression or element, after which the kernel ends the process
STEP_TIME = 1.2
PATIENCE = 60.0  # s; the child's own CPU time limits end it long before, unless it sleeps
MAX_NOTE = 10_000  # bytes that are read of a child that failed
MAX_OUTSIDE = 20  # robot files that are included from outside all known folders
_ROOT = str(Path(__file__).resolve().parents[3])
# Without `site`, whose search path is passed in instead, startup takes half as long.
BOOT = """
import pickle, sys
sys.path[:] = pickle.load(sys.stdin.buffer)
from holozen.robot.files.xacro_child import main
main()
"""


def expand_in_child(file: XacroFile) -> Outcome:
    """Expand a file in a process of its own, which reads only known folders. Takes 0.1 s, and
    terminates for any input.

    A robot file may be included from elsewhere: the child ends with its path, and is started again
    with the answer whether it is one.
    """
    outside: dict[str, bool] = {}
    for _ in range(MAX_OUTSIDE + 1):
        code, reply = _ask(file, outside)
        if code:
            return Outcome(error=_ended(file.path, code, reply))
        try:
            answer: str | Outcome = msgspec.convert(json.loads(reply), str | Outcome)
        except (ValueError, RecursionError):  # an expression wrote it
            return Outcome(
                error=f"{file.path}: xacro failed at the file: its reply is neither a text nor an "
                "error"
            )
        if isinstance(answer, Outcome):
            return answer
        outside[answer] = is_robot_file(answer)
    problem = f"more than {MAX_OUTSIDE} files are included from outside of all known packages"
    return Outcome(
        error=f"{file.path}: {problem}; give the package that holds them: --package NAME=DIR"
    )


def is_robot_file(path: str) -> bool:
    """Whether a file is XML whose root is a <robot> or an <sdf>. Nothing of its content is passed
    on.
    """
    roots: list[str] = []
    parser = ParserCreate()

    def start(name: str, _attributes: object) -> None:
        roots.append(name)
        raise StopIteration

    parser.StartElementHandler = start
    with contextlib.suppress(StopIteration, ExpatError, OSError, ValueError, RobotError):
        parser.Parse(read_text(Path(path)), True)
    return roots[:1] in (["robot"], ["sdf"])


def _ask(file: XacroFile, outside: Mapping[str, bool]) -> tuple[int, bytes]:
    """Exit code and reply of the child; of one that fails, the note of where it was, or standard
    error.
    """
    passed_on = ("LD_LIBRARY_PATH", *VARIABLES, *file.allow_env)
    env = {name: os.environ[name] for name in passed_on if name in os.environ}
    words = [sys.executable, "-I", "-S", "-X", "utf8", "-c", BOOT]
    plain = replace(
        file, args=dict(file.args), packages=dict(file.packages), allow_env=[*file.allow_env]
    )
    question = pickle.dumps([*map(str, sys.path), _ROOT]) + pickle.dumps(
        (plain, outside, [*os.environ])
    )
    # In memory: its size has a limit, which a pipe would not have, and there may be no writable
    # folder.
    with memory_file("reply") as reply:
        try:
            # A session of its own: only this process gets Ctrl-C, and it always ends the child.
            code = subprocess.run(
                words,
                input=question,
                stdout=reply,
                stderr=reply,
                env=env,
                start_new_session=True,
                timeout=PATIENCE,
            ).returncode
        except subprocess.TimeoutExpired:
            code = -signal.SIGKILL
        except OSError as error:
            raise RobotError(
                f"cannot start {sys.executable} to expand xacro: {error.strerror}"
            ) from None
        reply.seek(0)
        return code, reply.read(MAX_NOTE if code else -1)


def _ended(path: Path, code: int, found: bytes) -> str:
    """Why a child ended with a `code`, having left a note of where it was, or words of its
    interpreter's.
    """
    try:
        file, line, expression = msgspec.convert(
            json.loads(found.split(b"\n")[0]), tuple[str, int, str]
        )
        where = f"{file}, line {line}" if file else str(path)
        what = f"the expression {cut(expression, 200)}" if expression else "this element"
        last = f"exit code {code}"
    except (ValueError, RecursionError):
        where, what = str(path), "the file"
        last = (found.decode("utf-8", "replace").strip().splitlines() or [f"exit code {code}"])[-1]
    if code == -signal.SIGPROF:
        return f"{where}: {what} takes longer than the limit of {STEP_TIME:g} s"
    if code == -signal.SIGXCPU:
        return f"{where}: the file takes longer than the limit of {PROCESSOR_TIME} s"
    if code == -signal.SIGKILL:
        return f"{where}: {what} was ended after waiting more than {PATIENCE:g} s or out of memory"
    return f"{where}: xacro failed at {what}: {last}"


# Expansion.


# The namespace alone may remain after an expansion.
_XACRO = re.compile(r"<xacro:|\$\{|\$\((?:find|arg|env|optenv|eval|cwd|dirname|anon)\b")
_FORMAT = 1  # of a cache entry


def expand_xacro(
    path: Path,
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    allow_env: Collection[str] = (),
) -> str:
    """The text that the xacro library generates from a file: the output of its command line, and of
    `process_file(path).toprettyxml(indent="  ")`, byte for byte. The arguments are those of
    XacroFile.

    The text is sent to any node that serves `spawn_entity`, so it must not leak local data:
    `load_yaml` reads inside known packages only, and environment variables are read only if
    `allow_env` names them. Xacro evaluates Python expressions, in a process that the kernel keeps
    from other files, the network and other processes; all the same, never expand text received over
    the network. The library's warnings are printed. Raises RobotError with file, line and the chain
    of macros and includes.
    """
    outcome = expanded(XacroFile(path, args, packages, allow_env))
    for warning in outcome.warnings:
        report(f"warning: {warning}")
    return outcome.text


def expanded(file: XacroFile) -> Outcome:
    """As `expand_xacro`, but the warnings are returned."""
    outcome = process(file)
    if outcome.error:
        raise RobotError(outcome.error)
    return outcome


def process(file: XacroFile) -> Outcome:
    """As `expanded`, but errors of the library are returned too. A cached text is used until one of
    its inputs changes.

    Raises RobotError for errors before the library is called.
    """
    read_text(file.path)
    key = _key(file)
    entry = load_cached(key)
    if entry and current(entry["inputs"], file.path, file.packages) == entry["inputs"]:
        return Outcome(entry["text"], "", entry["inputs"], tuple(entry["warnings"]), True)
    outcome = expand_in_child(file)
    if outcome.pure and not outcome.error:
        store_cached(key, asdict(outcome))
    return outcome


def is_xacro(path: Path, text: str) -> bool:
    """Whether a robot file has to be expanded: by its name, or because it uses xacro."""
    return path.name.endswith(".xacro") or uses_xacro(text)


def uses_xacro(text: str) -> bool:
    """Whether any element uses xacro, outside of comments; False for broken XML, which is reported
    elsewhere.
    """
    try:
        return _XACRO.search(text) is not None and reader.run(bool, "the text", _uses_xacro, text)
    except RobotError:
        return False


def _uses_xacro(text: str) -> bool:
    tags = read_xml(repair_xml(text)[0], "").walk()
    words = (f"<{tag.name} {' '.join(tag.attributes.values())} {tag.text}" for tag in tags)
    return any(_XACRO.search(word) for word in words)


def _key(file: XacroFile) -> str:
    """Everything besides its inputs that determines a text, as text."""
    try:
        here = os.getcwd()  # where relative names start
    except OSError:
        here = ""
    packages = {name: str(folder) for name, folder in file.packages.items()}
    asked = [
        str(file.path),
        here,
        dict(file.args),
        packages,
        sorted(file.allow_env),
        os.path.expanduser("~"),
    ]
    return json.dumps([_FORMAT, *asked, sys.version, _code()], sort_keys=True)


def _code() -> list[tuple[str, int, int]]:
    """Name, size and time of each file of the library and of our modules for it: another version
    changes them.
    """
    here = Path(__file__).parent
    files = [
        *_library().glob("*.py"),
        here / "xacro.py",
        here / "xacro_child.py",
        here / "uris.py",
        here.parents[1] / "packages.py",
    ]
    stats = [(str(file), file.stat()) for file in files]
    return sorted((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats)


def _library() -> Path:
    from importlib.machinery import PathFinder

    found = PathFinder.find_spec("xacro")  # not what `holozen run` gives scripts by that name
    if found is None or found.origin is None:
        raise RobotError("the xacro library is missing; install it with: pip install xacro")
    return Path(found.origin).parent
