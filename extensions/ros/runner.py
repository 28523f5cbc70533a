"""Runs a user's script in this process, as `python3 script.py` would, with ROS's packages
importable.
"""

import atexit
import builtins
import contextlib
import gc
import importlib
import io
import os
import signal
import sys
import threading
import weakref
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec
from types import FrameType, ModuleType
from typing import Any

from holozen.process import INTERRUPTED
from holozen.ros import tracebacks
from holozen.ros.executables import Script
from holozen.ros.rclpy.context import ExternalShutdownException, end_at_exit
from holozen.suggest import suggest
from holozen.transport.errors import BusError

OF_EXTRA = ("numpy", "transforms3d")  # installed by `pip install 'holozen[run]'`

_opened: "weakref.WeakSet[io.IOBase]" = weakref.WeakSet()  # the files that the script opened


def real_ros() -> str:
    """The evidence that ROS itself is installed and sourced on this machine; empty if there is
    none.
    """
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
    """Run a script with these command-line arguments; the exit code.

    An error of the script prints its traceback and gives 1; an interrupt that it does not catch
    gives 130 without a traceback. BusError passes, and ModuleNotFoundError for what the extra `run`
    installs.
    """
    threading.excepthook = _show_thread_error
    _track_files()
    atexit.register(_end)
    sys.argv[:] = [str(script.path), *words]
    _put_first_on_path(str(script.root))
    try:
        if script.function:
            # None means success, a number is the exit code, a text is printed
            sys.exit(_call(script))
        _execute(script)
    except SystemExit as end:
        return _exit_code(end.code)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BusError:
        raise
    except Exception as error:
        if (
            isinstance(error, ModuleNotFoundError)
            and (error.name or "").partition(".")[0] in OF_EXTRA
        ):
            raise
        tracebacks.show(error)
        return 1
    finally:
        _clean_up_on_interrupt()
    return 0


def _exit_code(code: Any) -> int:
    """The code of SystemExit as Python interprets it: None is 0, a number itself, anything else is
    printed and is 1.
    """
    if code is None or isinstance(code, int):
        return (code or 0) & 0xFF
    print(code, file=sys.stderr)
    return 1


def _show_thread_error(args: threading.ExceptHookArgs) -> None:
    """For threading.excepthook. A thread that ends because rclpy was shut down is no error."""
    if isinstance(args.exc_value, ExternalShutdownException):
        return
    if args.exc_value is not None:
        tracebacks.clean(args.exc_value)
        args = threading.ExceptHookArgs(
            (args.exc_type, args.exc_value, args.exc_value.__traceback__, args.thread)
        )
    threading.__excepthook__(args)


def _clean_up_on_interrupt() -> None:
    """Ctrl-C while the script's threads end: shut down rclpy and write the files, since no callback
    of atexit runs.
    """
    before = signal.getsignal(signal.SIGINT)

    def interrupted(number: int, frame: FrameType | None) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            if callable(before):
                before(number, frame)
        end_at_exit()
        _end()

    signal.signal(signal.SIGINT, interrupted)


def _track_files() -> None:
    """Remember the files that the script opens, to flush them at its end."""
    original = io.open

    def tracked(*args: Any, **kwargs: Any) -> Any:
        file = original(*args, **kwargs)
        _opened.add(file)
        return file

    builtins.open = io.open = tracked


def _end() -> None:
    """Write what the script has buffered, and drop its names as Python does at its end.

    `holozen.process.Ending` ends the process without Python's own clean-up, which Zenoh's threads
    do not survive.
    """
    threading.excepthook = lambda _: None  # daemon threads may fail now
    for file in list(_opened):
        with contextlib.suppress(Exception):
            # first: a file in a reference cycle may lose its descriptor before its buffer is
            # written
            file.flush()
    sys.modules["__main__"].__dict__.clear()  # closes a GzipFile, which writes its end then
    gc.collect()


def _put_first_on_path(folder: str) -> None:
    """Put the script's folder where Python would: that place holds the folder of the `holozen`
    command.
    """
    if sys.flags.safe_path or not sys.path:
        sys.path.insert(0, folder)
    else:
        sys.path[0] = folder


def _execute(script: Script) -> None:
    name = str(script.path)
    code = compile(script.path.read_bytes(), name, "exec", dont_inherit=True)
    # It stays `__main__` until the interpreter ends: threads and exit handlers of the script use
    # its names.
    main = sys.modules["__main__"] = ModuleType("__main__")
    main.__dict__.update(
        __file__=name, __cached__=None, __annotations__={}, __builtins__=__builtins__
    )
    main.__loader__ = SourceFileLoader("__main__", name)
    exec(code, main.__dict__)


def _call(script: Script) -> Any:
    found: Any = importlib.import_module(script.module)
    for name in script.function.split("."):
        known, found = dir(found), getattr(found, name, None)
    if not callable(found):
        entry = f"{script.module}:{script.function}"
        raise TypeError(
            f"{entry} in the package's setup file is not a function{suggest(name, known)}"
        )
    return found()
