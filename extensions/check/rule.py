"""A rule of `check`: a function that inspects a robot file, with its name, its severity and what it
is for.
"""

from collections.abc import Callable, Iterable

from msgspec import Struct

from holozen.check.mistake import Mistake, Severity
from holozen.check.subject import Subject

Find = Callable[[Subject], Iterable[Mistake]]


class Rule(Struct, frozen=True):
    """A rule: `finds` and `why` describe it, `find` inspects a robot file. With an "error" the
    robot cannot be used as intended; with a "warning" it can.
    """

    name: str
    severity: Severity
    finds: str
    why: str
    find: Find


def rule(name: str, severity: Severity, finds: str, why: str) -> Callable[[Find], Rule]:
    """Makes a Rule of a function that inspects a robot file."""
    return lambda find: Rule(name, severity, finds, why, find)
