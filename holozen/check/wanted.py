"""What a task asks for: a size, and names."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from holozen.check.finding import Mistake, Place
from holozen.check.inertias import told
from holozen.check.placed import box_of, size_of
from holozen.check.subject import Subject
from holozen.check.words import closest
from holozen.robot.errors import RobotError, listed
from holozen.robot.parts import JOINT_KINDS
from holozen.robot.xacro import read_text

GRAIN = 1e-6  # m; what sums of decimal figures are off by


@dataclass(frozen=True, slots=True)
class Need:
    """A link or joint that has to be there; a joint may have to be of a type."""

    kind: str
    name: str
    type: str = ""


def too_large(subject: Subject) -> Iterator[Mistake]:
    """A robot larger than --fits says: collision shapes, and visual ones that are no meshes, all joints at zero."""
    fits = subject.wanted.fits
    shapes = [shape for shape in subject.placed if shape.use == "collision" or not shape.points]
    box = box_of(shapes)
    if not fits or subject.model is None:
        return
    if box is None:
        yield Mistake(subject.root, "the robot has no shape to measure", "give its links <collision> shapes")
        return
    size = size_of(box)
    names = ("length (x)", "width (y)", "height (z)")
    over = [f"{name} {size[i]:.3g} m" for i, name in enumerate(names) if i < len(fits) and size[i] > fits[i] + GRAIN]
    if over:
        limit = " x ".join(f"{value:g}" for value in fits)
        problem = f"the robot measures {told(size)}, and has to fit into {limit} m: {', '.join(over)} is too much"
        yield Mistake(subject.root, problem, "make it smaller, or bring its parts together")


def bad_needs(subject: Subject) -> Iterator[Mistake]:
    """Lines of the --require file that say nothing."""
    for line, need in _needs(subject):
        if isinstance(need, str):
            mend = "write `link NAME` or `joint NAME`, or `joint NAME TYPE`; # starts a comment"
            yield Mistake(Place(str(subject.wanted.require), line), need, mend)


def missing_names(subject: Subject) -> Iterator[Mistake]:
    """Links and joints that the --require file names and that are not there, or joints of another type."""
    for _, need in _needs(subject):
        if isinstance(need, str):
            continue
        there = subject.links if need.kind == "link" else subject.joints
        if need.name not in there:
            problem = f"there is no {need.kind} {need.name!r}{closest(need.name, there)}"
            yield Mistake(subject.root, problem, f"rename or add one; there are: {listed(list(there))}")
        elif need.type and (kind := there[need.name].attributes.get("type")) != need.type:
            yield Mistake(there[need.name], f"joint {need.name!r} is {kind}, not {need.type}", f'type="{need.type}"')


def _needs(subject: Subject) -> Iterator[tuple[int, Need | str]]:
    """Line number, and what has to be there or what is wrong with the line."""
    return iter(read_needs(subject.wanted.require)) if subject.wanted.require else iter(())


def read_needs(path: Path) -> list[tuple[int, Need | str]]:
    """The lines of a --require file: line number, and what has to be there or what is wrong with the line."""
    try:
        lines = read_text(path).splitlines()
    except RobotError as error:
        return [(0, str(error))]
    words = [(number, line.partition("#")[0].split()) for number, line in enumerate(lines, 1)]
    return [(number, _need(line)) for number, line in words if line]


def _need(words: list[str]) -> Need | str:
    kind, *rest = words
    if kind not in ("link", "joint"):
        return f"{kind[:40]!r} is no kind of thing; there are link and joint"
    if not rest or len(rest) > (1 if kind == "link" else 2):
        return f"{' '.join(words)[:60]!r} has {len(rest)} words after {kind!r}"
    if len(rest) == 2 and rest[1] not in JOINT_KINDS:
        return f"there is no joint type {rest[1][:40]!r}; there are {', '.join(JOINT_KINDS)}"
    return Need(kind, *rest)
