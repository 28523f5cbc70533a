"""Runs a user's script in this process, as `python3 script.py` would, with ROS's packages importable."""

import atexit
import contextlib
import gc
import importlib
import io
import os
import sys
import threading
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from holozen.errors import BusError
from holozen.process import INTERRUPTED
from holozen.ros import traceback
from holozen.ros.executables import Script

LAST = (io.BufferedWriter, io.BufferedRandom)
OF_EXTRA = ("numpy", "transforms3d")  # what `pip install 'holozen[run]'` brings


def real_ros() -> str:
    """What says that ROS itself is on this machine's path, in words; empty if nothing does."""
    if name := os.environ.get("ROS_DISTRO"):
        return f"ROS is sourced in this terminal (ROS_DISTRO={name})"
    try:
        spec = find_spec("rclpy")
    except (ImportError, ValueError):
        return ""
    if spec is None:
        return ""
    return f"ROS's own rclpy can be imported here ({spec.origin or 'a namespace package'})"


def run(script: Script, words: list[str]) -> int:
    """Run a script with these words as its arguments; the exit code.

    An error of the script is told by its own traceback, and gives 1; an interrupt that it does not catch gives 130
    without one. BusError passes, and ModuleNotFoundError for what the extra `run` installs.
    """
    threading.excepthook = traceback.show_of_thread
    atexit.register(_close_files)
    sys.argv[:] = [str(script.path), *words]
    _look_first_in(str(script.root))
    try:
        if script.function:
            sys.exit(_called(script))  # None is a good end, a number the exit code, a text is told
        _executed(script)
    except SystemExit as end:
        return _exit_code(end.code)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BusError:
        raise
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] in OF_EXTRA:
            raise
        traceback.show(error)
        return 1
    return 0


def _exit_code(code: Any) -> int:
    """What SystemExit says, as Python takes it: a number, nothing for 0, anything else is told and is 1."""
    if code is None or isinstance(code, int):
        return (code or 0) & 0xFF
    print(code, file=sys.stderr)
    return 1


def _close_files() -> None:
    """Python does so at its end. `holozen.process.leave` takes another way out, and what waits would not be written."""
    threading.excepthook = lambda _: None  # a daemon that still writes is no news
    open_ones = [each for each in gc.get_objects() if issubclass(type(each), io.IOBase) and _holds(type(each))]
    open_ones.sort(
        key=lambda each: 2 * isinstance(each, LAST) - isinstance(each, io.TextIOWrapper)
    )  # what writes into another one goes first
    for each in open_ones:
        with contextlib.suppress(Exception):
            each.flush()
            if not _is_standard(each):
                each.close()


def _holds(kind: type) -> bool:
    """Whether a kind of file may hold what is not written yet."""
    return not issubclass(kind, io.RawIOBase | io.BufferedReader | io.BytesIO | io.StringIO)


def _is_standard(file: io.IOBase) -> bool:
    try:
        return file.fileno() <= 2
    except OSError:  # it has no number
        return False


def _look_first_in(folder: str) -> None:
    """Python puts the script's folder where that of the interpreter's own command stands."""
    if sys.flags.safe_path or not sys.path:
        sys.path.insert(0, folder)
    else:
        sys.path[0] = folder


def _executed(script: Script) -> None:
    name = str(script.path)
    code = compile(script.path.read_bytes(), name, "exec", dont_inherit=True)
    # It stays `__main__` to the interpreter's end: threads and exit handlers of the script look there.
    main = sys.modules["__main__"] = ModuleType("__main__")
    main.__dict__.update(__file__=name, __cached__=None, __annotations__={}, __builtins__=__builtins__)
    main.__loader__ = SourceFileLoader("__main__", name)
    exec(code, main.__dict__)


def _called(script: Script) -> Any:
    found: Any = importlib.import_module(script.module)
    for name in script.function.split("."):
        found = getattr(found, name)
    if not callable(found):
        raise TypeError(f"{script.module}:{script.function} is no function")
    return found()
