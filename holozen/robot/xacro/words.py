"""The one line for what the xacro library raised."""

from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any
from xml.parsers.expat import ErrorString, ExpatError

from holozen.robot.errors import RobotError, near
from holozen.robot.xacro.lines import Place
from holozen.robot.xacro.trace import Trace

MOST_MEMORY = 512 << 20  # bytes of address space of the child


def told(error: BaseException, trace: Trace, path: Path, guesses: Mapping[str, Path]) -> str:
    """File, line, reason, hint, and the chain of macros and includes. `guesses` are packages found by place only."""
    cause, suffix = _cause(error)
    chain = _chain(trace.calls)
    if isinstance(cause, RobotError):
        return f"{_placed(str(cause), path, trace)}{chain}"
    args = trace.library.substitution_args_context.get("arg", {})
    hint = getattr(cause, "hint", "") or (_guessed(guesses) if isinstance(cause, OSError) else "")
    if type(cause).__name__ == "ArgException":
        hint = near(str(cause), list(args))
    return f"{_where(cause, trace)}: {_reason(cause, suffix)}{hint}{chain}"


def _placed(told: str, path: Path, trace: Trace) -> str:
    """Whoever looks for packages and files does not know who asked for them."""
    if trace.place is None or str(trace.place) in told:
        return told
    if told.startswith(f"{path}: "):
        return f"{trace.place}{told.removeprefix(str(path))}"
    return told if trace.calls else f"{told} (asked for at {trace.place})"


def _where(cause: BaseException, trace: Trace) -> str:
    file = next((str(file) for file in reversed(trace.library.filestack or [""])), "")
    if isinstance(cause, ExpatError):
        return str(Place(file, cause.lineno))
    if isinstance(cause, UnicodeDecodeError):
        return file
    return str(trace.place or file)


def _reason(cause: BaseException, suffix: str) -> str:
    kind = type(cause).__name__
    if isinstance(cause, ExpatError):
        return f"broken XML: {ErrorString(cause.code)}"
    if isinstance(cause, OSError):
        return f"{cause.strerror}: {cause.filename}"
    if isinstance(cause, UnicodeDecodeError):
        return "it is no UTF-8 text; save the file as UTF-8"
    if isinstance(cause, RecursionError):
        return "a macro, a property or an include calls itself without end, or elements are nested too deep"
    if isinstance(cause, MemoryError):
        return f"it needs too much memory; an expansion has {MOST_MEMORY >> 20} MB {suffix}".rstrip()
    if kind == "ArgException":
        return f"$(arg {cause}) has no value; give one with {cause}:=VALUE or a default in <xacro:arg>"
    words = str(cause) if not isinstance(cause, KeyError) else f"there is no {cause}"
    return cut(f"{words or kind} {suffix}")


def cut(text: str, most: int = 400) -> str:
    """`text` as one line of at most `most` characters."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 3]}..."


def _cause(error: Any) -> tuple[BaseException, str]:
    """The innermost of the library's wrapped errors, and the innermost "when evaluating ..." on the way."""
    suffix = ""
    while isinstance(getattr(error, "exc", None), Exception):
        suffix = getattr(error, "suffix", None) or suffix
        error = error.exc
    return error, cut(suffix, 200)


def _chain(calls: list[str], most: int = 6) -> str:
    runs = ((call, len(list(same))) for call, same in groupby(reversed(calls)))
    chain = [call if times == 1 else f"{call}, {times} times" for call, times in runs]
    cut = [f"and {len(chain) - most} more"] if len(chain) > most else []
    return f" ({', '.join([*chain[:most], *cut])})" if chain else ""


def _guessed(guesses: Mapping[str, Path]) -> str:
    """A hint for each package that nothing but the place of the robot file spoke for."""
    return "".join(
        f"; no package.xml says {name!r}, so {folder} was taken for it: if wrong, give --package {name}=DIR"
        for name, folder in guesses.items()
    )
