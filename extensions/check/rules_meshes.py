"""Mesh files: whether they exist, can be read, and are in metres; and whether the robot is."""

import math
from collections.abc import Iterator
from pathlib import Path

from holozen.check.geometry import Placed, around, box_of, size_of
from holozen.check.mistake import Mistake
from holozen.check.rule import rule
from holozen.check.subject import Subject
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Tag, number
from holozen.robot.files.meshes import bounds
from holozen.robot.files.uris import is_data, resolve_uri
from holozen.robot.model import Vector
from holozen.robot.rigid import link_frames

PACKAGE = "put the file there, or write package://PACKAGE/PATH"
MODEL = (
    "put the file into MODEL beside this model, or add the folder that contains MODEL to "
    "GAZEBO_MODEL_PATH"
)
FACTOR = 20.0  # times larger than the rest of the robot, or smaller than the rest of its link
TINY = 500.0  # times smaller than the rest of the robot
ALONE = 200.0  # times larger than all shapes other than meshes
LARGEST, SMALLEST = 100.0, 0.001  # m; for a mesh without other shapes
OVERSIZED = 20.0  # m; for a robot
UNITS = {
    0.001: "millimetres",
    0.01: "centimetres",
    0.0254: "inches",
    1000.0: "",
    100.0: "",
    1 / 0.0254: "",
}
"""Factor to metres -> the unit that the file may be in; empty if it may have been scaled twice."""


@rule("mesh", "error", "a mesh that is not found", "the part is invisible or a box")
def _missing(subject: Subject) -> Iterator[Mistake]:
    """The first finding lists the packages searched."""
    searched = ""
    for tag, uri, _ in _meshes(subject):
        try:
            resolve_uri(uri, subject.path, subject.packages)
        except RobotError as error:
            short, places, rest = str(error).partition("; packages found: ")
            problem = short if searched and searched == rest else str(error)
            searched = rest if places else searched
            yield Mistake(
                tag, f"mesh: {problem}", MODEL if uri.lower().startswith("model:") else PACKAGE
            )


@rule(
    "mesh-path",
    "warning",
    "a mesh at a path on another machine",
    "it is not found on other machines",
)
def _elsewhere(subject: Subject) -> Iterator[Mistake]:
    """It was found here by its file name."""
    for tag, uri, _ in _meshes(subject):
        lines: list[str] = []
        try:
            resolve_uri(uri, subject.path, subject.packages, warn=lines.append)
        except RobotError:
            continue
        for line in lines:
            yield Mistake(tag, f"mesh: {line}", "write package://PACKAGE/PATH")


@rule("mesh-empty", "error", "a mesh that is empty or broken", "the part has no shape")
def _unreadable(subject: Subject) -> Iterator[Mistake]:
    for tag, uri, _ in _meshes(subject):
        path = _path(uri, subject)
        if path:
            try:
                bounds(path)
            except RobotError as error:
                again = "then check again" if "git lfs pull" in str(error) else "export it again"
                yield Mistake(tag, f"mesh {error}", again)


@rule("mesh-unit", "warning", "a mesh in the wrong unit", "it is far too large or too small")
def _units(subject: Subject) -> Iterator[Mistake]:
    """Compares the size of a mesh with the rest of the robot."""
    if subject.model is None:
        return
    for tag, uri, scale in _meshes(subject):
        path = _path(uri, subject)
        size = _size(path, scale) if path else 0.0
        if path and size:
            other = _other(subject, tag, path, size)
            if other:
                factor = min(UNITS, key=lambda factor: abs(math.log(size * factor / other)))
                unit = f"; its file may be in {UNITS[factor]}" if UNITS[factor] else ""
                scaled = " ".join(f"{value * factor:.4g}" for value in scale)
                problem = (
                    f"mesh {path.name} is {size:.3g} m large, where {other:.3g} m would "
                    f"match the rest{unit}"
                )
                yield Mistake(tag, problem, f'scale="{scaled}" makes it {size * factor:.3g} m')


@rule("robot-unit", "warning", "a robot of more than 20 m", "lengths are in metres")
def _robot_units(subject: Subject) -> Iterator[Mistake]:
    """Measured without its meshes, which have a rule of their own."""
    if size := too_large(subject):
        problem = f"the robot measures {size:.3g} m; its file may be in millimetres"
        yield Mistake(subject.root, problem, "write all lengths in metres: 0.3 for 300 mm")


def too_large(subject: Subject) -> float:
    """The size of a robot that is too large to be meant in metres; 0 for any other, or if it cannot
    move.
    """
    size = _largest([shape for shape in subject.placed if shape.shape.path is None])
    return size if size > OVERSIZED and not subject.loaded.static else 0.0


def _other(subject: Subject, tag: Tag, path: Path, size: float) -> float:
    """The size in metres that would suit a mesh; 0 if its own is plausible."""
    rest = [shape for shape in subject.placed if shape.shape.path != path]
    link = subject.part(tag).attributes.get("name", "")
    own, every, bare = (
        _largest([shape for shape in rest if shape.link == link]),
        _largest(rest, subject),
        _largest([shape for shape in rest if shape.shape.path is None], subject),
    )
    if every and size > FACTOR * every:
        return every
    if bare > 0.01 and size > ALONE * bare:
        return bare
    if (own and size < own / FACTOR) or (every and size < every / TINY):
        return own or every
    alone = subject.plugins and not every and not SMALLEST < size < LARGEST
    return 0.3 if alone else 0.0


def _largest(shapes: list[Placed], origins: Subject | None = None) -> float:
    """The longest edge in metres of the bounding box of shapes, and of all link frames of
    `origins`, if given.
    """
    box = box_of(shapes)
    points = list(box) if box else []
    if origins is not None and origins.model is not None:
        points += [frame.position for frame in link_frames(origins.model).values()]
    return float(max(size_of(around(points)))) if points else 0.0


def _meshes(subject: Subject) -> Iterator[tuple[Tag, str, Vector]]:
    """Each mesh of a link, its URI, and its scale."""
    for link in subject.root.all("link"):
        for tag in link.below("mesh"):
            uri = (tag.given("uri" if tag.sdf else "filename") or "").strip()
            if uri and not is_data(uri):
                yield tag, uri, _scale(tag.given("scale") or "")


def _scale(text: str) -> Vector:
    values = [number(word) for word in text.split()]
    x, y, z = values if len(values) == 3 and all(values) else (1.0, 1.0, 1.0)
    return x or 1.0, y or 1.0, z or 1.0


def _path(uri: str, subject: Subject) -> Path | None:
    try:
        return resolve_uri(uri, subject.path, subject.packages)
    except RobotError:
        return None


def _size(path: Path, scale: Vector) -> float:
    try:
        low, high = bounds(path, scale)
        return max(b - a for a, b in zip(low, high, strict=True))
    except RobotError:
        return 0.0
