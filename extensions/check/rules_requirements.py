"""The requirements of a task: the size of the robot (--fits), and the names of links and joints
(--require).
"""

from collections.abc import Iterator

from msgspec import Struct

from holozen.check.geometry import box_of, size_of
from holozen.check.mistake import Location, Mistake
from holozen.check.rule import rule
from holozen.check.rules_inertia import dimensions
from holozen.check.subject import Subject
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import read_text
from holozen.robot.model import JOINT_KINDS
from holozen.suggest import listed, suggest

GRAIN = 1e-6  # m; rounding error of sums of decimals


class RequiredPart(Struct, frozen=True):
    """A required link or joint, optionally with a joint type."""

    kind: str
    name: str
    type: str = ""


@rule("fits", "error", "a robot larger than --fits", "the task sets its size")
def _too_large(subject: Subject) -> Iterator[Mistake]:
    """Measures collision shapes, and visual ones except meshes, with all joints at zero."""
    fits = subject.requirements.fits
    shapes = [
        shape for shape in subject.placed if shape.use == "collision" or shape.solid.kind != "hull"
    ]
    box = box_of(shapes)
    if not fits or subject.model is None:
        return
    if box is None:
        yield Mistake(
            subject.root, "the robot has no shape to measure", "give its links <collision> shapes"
        )
        return
    size = size_of(box)
    names = ("length (x)", "width (y)", "height (z)")
    over = [
        f"{name} {size[i]:.3g} m"
        for i, name in enumerate(names)
        if i < len(fits) and size[i] > fits[i] + GRAIN
    ]
    if over:
        limit = " x ".join(f"{value:g}" for value in fits)
        problem = (
            f"the robot measures {dimensions(size)}, and has to fit into {limit} m: "
            f"{', '.join(over)} is too much"
        )
        yield Mistake(subject.root, problem, "make it smaller, or bring its parts together")


@rule("require-file", "error", "an invalid line of --require", "it checks nothing")
def _wrong_lines(subject: Subject) -> Iterator[Mistake]:
    for line, part in _required_parts(subject):
        if isinstance(part, str):
            fix = "write `link NAME` or `joint NAME`, or `joint NAME TYPE`; # starts a comment"
            yield Mistake(Location(str(subject.requirements.require), line), part, fix)


@rule("require", "error", "a missing link or joint of --require", "the task sets its names")
def _missing_names(subject: Subject) -> Iterator[Mistake]:
    for _, part in _required_parts(subject):
        if isinstance(part, str):
            continue
        there = subject.links if part.kind == "link" else subject.joints
        if part.name not in there:
            problem = f"there is no {part.kind} {part.name!r}{suggest(part.name, there)}"
            yield Mistake(subject.root, problem, f"rename or add one; there are: {listed(there)}")
        elif part.type and (kind := there[part.name].attributes.get("type")) != part.type:
            yield Mistake(
                there[part.name],
                f"joint {part.name!r} is {kind}, not {part.type}",
                f'type="{part.type}"',
            )


def _required_parts(subject: Subject) -> list[tuple[int, RequiredPart | str]]:
    """The lines of the --require file: line number, and the requirement or what is wrong with the
    line.
    """
    try:
        lines = (
            read_text(subject.requirements.require).splitlines()
            if subject.requirements.require
            else []
        )
    except RobotError as error:
        return [(0, str(error))]
    words = [(number, line.partition("#")[0].split()) for number, line in enumerate(lines, 1)]
    return [(number, _required_part(line)) for number, line in words if line]


def _required_part(words: list[str]) -> RequiredPart | str:
    kind, *rest = words
    if kind not in ("link", "joint"):
        return f"{kind[:40]!r} is not a kind; write link or joint"
    if not rest or len(rest) > (1 if kind == "link" else 2):
        return f"{' '.join(words)[:60]!r} has {len(rest)} words after {kind!r}"
    if len(rest) == 2 and rest[1] not in JOINT_KINDS:
        return f"there is no joint type {rest[1][:40]!r}; there are {', '.join(JOINT_KINDS)}"
    return RequiredPart(kind, *rest)
