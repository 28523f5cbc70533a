"""A robot file -> the subject of a check."""

from collections.abc import Mapping
from pathlib import Path

from holozen.check.finding import Mistake, Place
from holozen.check.sources import SourceFile, elements, read_sources, trace
from holozen.check.subject import Subject, Told, Wanted, split
from holozen.robot.errors import RobotError
from holozen.robot.model import RobotModel, parse
from holozen.robot.tag import Tag, read_xml
from holozen.robot.xacro import is_xacro, process, read_text
from holozen.robot.xacro.inputs import Outcome

EXPANDED = " (expanded)"  # after the file's name, in messages about the expanded text
SEE_WORLD = "; see it with: holozen sim --world FILE"
SILENT = ("gazebo", "plugin", "sensor", "material", "inertial", "mesh")
"""Where the loader's warnings are no mistakes of the file, or have rules of their own."""


def read(path: Path, args: Mapping[str, str], packages: Mapping[str, Path], wanted: Wanted) -> Subject:
    """The file, expanded and loaded as far as it can be. Raises RobotError if it is no robot's XML."""
    text = read_text(path)
    expanded = is_xacro(path, text)
    outcome = process(path, args, packages) if expanded else Outcome(text)
    if outcome.error:
        raise RobotError(outcome.error)
    plain, place = outcome.text, f"{path}{EXPANDED}" if expanded else str(path)
    root = read_xml(plain, place)
    sources = read_sources(path, packages) if expanded else []
    robot = _robot(root)
    subject = Subject(path, robot, sources, packages, wanted, robot.name == "model")
    subject.origins = _origins(root, sources, args, packages, path) if expanded else {}
    for line in outcome.warnings:
        at, told = split(line, path)
        subject.told.append(Told("warning", at, told))
    if not (expanded and is_library(root)):
        _load(subject, root, plain, place)
    return subject


def is_library(root: Tag) -> bool:
    """Whether a xacro file only has colours, properties and macros for others to include."""
    return root.name == "robot" and all(tag.name in ("material", "gazebo") for tag in root.children)


def said(subject: Subject, severity: str) -> list[Mistake]:
    """What the loader said with this severity."""
    mend = "mend it as the line says" if severity == "error" else "see the line"
    return [Mistake(told.at, told.text, mend) for told in subject.told if told.severity == severity]


def _robot(root: Tag) -> Tag:
    if root.name == "robot":
        return root
    if root.name == "sdf" and root.first("world") is None:
        model = root.first("model")
        if model is None:
            raise root.wrong("holds no <model>")
        return model
    if root.name == "sdf":
        raise root.wrong(f"is a world{SEE_WORLD}")
    raise root.wrong("is no robot; a URDF file starts with <robot name=...>, an SDF file with <sdf version=...>")


def _load(subject: Subject, root: Tag, text: str, place: str) -> None:
    by_line: dict[int, list[Tag]] = {}
    for tag in elements(root):
        by_line.setdefault(_line(tag), []).append(tag)
    try:
        subject.model = _model(subject, root, text, place)
        lines = [("warning", line) for line in subject.model.warnings]
    except RobotError as error:
        lines = [("error", str(error))]
    for severity, line in lines:
        where, told = split(line, subject.path)
        here = by_line.get(where.line, []) if where.file == place else []
        # A line may hold several elements; the message starts with the one it means.
        at = next((tag for tag in here if told.startswith(f"{tag} ")), here[0] if here else where)
        quiet = isinstance(at, Tag) and (_within(at, SILENT) or at.attributes.get("name") == "world")
        if severity == "error" or not quiet:
            subject.told.append(Told(severity, at, told))


def _model(subject: Subject, root: Tag, text: str, place: str) -> RobotModel:
    if not subject.sdf:
        return parse(text, subject.path, subject.packages, place)
    from holozen.robot.sdf.models import parse_sdf
    from holozen.robot.source import Source

    return parse_sdf(root, Source(subject.path, subject.packages))


def _within(tag: Tag | None, names: tuple[str, ...]) -> bool:
    while tag is not None:
        if tag.name in names:
            return True
        tag = tag.parent
    return False


def _origins(
    root: Tag, sources: list[SourceFile], args: Mapping[str, str], packages: Mapping[str, Path], path: Path
) -> dict[Tag, Place]:
    """Element of the expanded text -> its place in a source file, or in the text where that is not known."""
    try:
        marks = trace(root, sources, args, packages)
    except (RobotError, OSError):
        marks = []
    tags = list(elements(root))
    places = {tag: Place(str(path), _line(tag), True) for tag in tags}
    for tag, mark in zip(tags, marks, strict=False):
        number, colon, line = mark.partition(":")
        if colon:
            places[tag] = Place(str(sources[int(number)].path), int(line))
    return places


def _line(tag: Tag) -> int:
    return int(tag.place.rpartition(", line ")[2])
