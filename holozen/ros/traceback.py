"""A traceback of the user's code alone: what Python prints, without the frames of this package in between."""

import sys
import threading
from pathlib import Path
from types import TracebackType

from holozen.ros import missing
from holozen.ros.ament_index_python import PackageNotFoundError
from holozen.ros.context import ExternalShutdownException
from holozen.ros.table import MODULES

_OURS = str(Path(__file__).resolve().parents[1]) + "/"
_MACHINERY = ("<frozen importlib", "<frozen runpy")


def show(error: BaseException) -> None:
    """Print the traceback of an error to standard error as Python does at the end of a script.

    The user's own sys.excepthook is asked. With `python -X dev` every frame is shown.
    """
    if not sys.flags.dev_mode:
        _strip(error, set())
    sys.excepthook(type(error), error, error.__traceback__)


def show_of_thread(args: threading.ExceptHookArgs) -> None:
    """For threading.excepthook: what `show` does. A thread that ends because rclpy did has nothing to tell."""
    if isinstance(args.exc_value, ExternalShutdownException):
        return
    if args.exc_value is not None and not sys.flags.dev_mode:
        _strip(args.exc_value, set())
        args = threading.ExceptHookArgs((args.exc_type, args.exc_value, args.exc_value.__traceback__, args.thread))
    threading.__excepthook__(args)


def in_one_line(error: Exception) -> str:
    """An error that says all by itself, after the user's file and line: what cannot be imported, a package that is not
    there, a name that ROS has and this has not. Empty for any other.
    """
    told = isinstance(error, ImportError | PackageNotFoundError) or missing.PAGE in str(error)
    return _placed(error) if told else ""


def of_an_argument(error: Exception) -> str:
    """An error of ours about what a launch file gave us, after its file and line. Empty for any other."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    inner = trace is not None and trace.tb_frame.f_code.co_filename.startswith(_OURS)
    return _placed(error) if inner and isinstance(error, TypeError | ValueError) else ""


def _placed(error: Exception) -> str:
    trace = users_own(error.__traceback__)
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}: " if trace else ""
    return f"{place}{' '.join(str(error).split())}"


def _strip(error: BaseException, seen: set[int]) -> None:
    seen.add(id(error))
    error.__traceback__ = users_own(error.__traceback__)
    _name(type(error))
    for other in (error.__cause__, error.__context__):
        if other is not None and id(other) not in seen:
            _strip(other, seen)


def _name(kind: type) -> None:
    """Let a class of ours be shown by the name that ROS has for it; what ROS has not, by its own alone."""
    if kind.__module__.startswith("holozen."):
        kind.__module__ = next((name for name, ours in MODULES.items() if ours == kind.__module__), "builtins")


def users_own(trace: TracebackType | None) -> TracebackType | None:
    """A traceback without our frames and without those of the import system."""
    frames = []
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        if not name.startswith((_OURS, *_MACHINERY)):
            frames.append(trace)
        trace = trace.tb_next
    found: TracebackType | None = None
    for frame in reversed(frames):
        found = TracebackType(found, frame.tb_frame, frame.tb_lasti, frame.tb_lineno)
    return found
