"""Tracebacks that show the user's code alone: what Python prints, without the frames of this
package in between.
"""

import contextlib
import importlib
import linecache
import sys
from types import TracebackType

import holozen
from holozen.ros import importer
from holozen.ros.ament_index_python import PackageNotFoundError
from holozen.ros.catalog import MODULES, PAGE

_OURS = tuple(f"{folder}/" for folder in holozen.__path__)
_MACHINERY = (
    "<frozen importlib",
    "<frozen runpy",
    *(str(each.__file__) for each in (contextlib, importlib)),
)


def show(error: BaseException) -> None:
    """Print the traceback of an error to standard error as Python does at the end of a script.

    A sys.excepthook of the script's own is called. With `python -X dev` every frame is shown.
    """
    clean(error)
    sys.excepthook(type(error), error, error.__traceback__)


def clean(error: BaseException) -> None:
    """Remove our frames from the traceback of an error and of its causes, and use ROS's names for
    our classes.

    With `python -X dev` it changes nothing.
    """
    if not sys.flags.dev_mode:
        _clean(error, set())


def user_frames(trace: TracebackType | None) -> TracebackType | None:
    """A traceback without our frames and without those of the import system."""
    frames = []
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        if not name.startswith((*_OURS, *_MACHINERY)):
            frames.append(trace)
        trace = trace.tb_next
    found: TracebackType | None = None
    for frame in reversed(frames):
        found = TracebackType(found, frame.tb_frame, frame.tb_lasti, frame.tb_lineno)
    return found


def import_error_line(error: Exception) -> str:
    """One line, with the user's file and line, for an error that needs no traceback: a failed
    import, a package that is not found, a name of ROS that does not exist here. Empty for any
    other.
    """
    if isinstance(error, ModuleNotFoundError):
        _explain(error)
    return (
        _located(error)
        if isinstance(error, ImportError | PackageNotFoundError) or PAGE in str(error)
        else ""
    )


def argument_error_line(error: Exception) -> str:
    """One line, with the launch file and its line, for an error that our code raised about an
    argument of the launch file. Empty for any other.
    """
    trace = _innermost(error.__traceback__)
    is_ours = trace is not None and trace.tb_frame.f_code.co_filename.startswith(_OURS)
    return _located(error) if is_ours and isinstance(error, TypeError | ValueError) else ""


def _located(error: Exception) -> str:
    trace = _innermost(user_frames(error.__traceback__))
    place = f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}: " if trace else ""
    return f"{place}{' '.join(str(error).split())}"


def _innermost(trace: TracebackType | None) -> TracebackType | None:
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace


def _clean(error: BaseException, seen: set[int]) -> None:
    seen.add(id(error))
    error.__traceback__ = user_frames(error.__traceback__)
    kind = type(error)
    if kind.__module__.startswith("holozen."):  # what ROS does not have is shown without a module
        kind.__module__ = next(
            (name for name, ours in MODULES.items() if ours == kind.__module__), "builtins"
        )
    if isinstance(error, ModuleNotFoundError):
        _explain(error)
    for other in (error.__cause__, error.__context__):
        if other is not None and id(other) not in seen:
            _clean(other, seen)


def _explain(error: ModuleNotFoundError) -> None:
    """Name the folders searched where the package of a message was not found."""
    trace = _innermost(user_frames(error.__traceback__))
    line = linecache.getline(trace.tb_frame.f_code.co_filename, trace.tb_lineno) if trace else ""
    error.msg = importer.explain(error, line) or error.msg
