"""SDF models -> robots and other bodies."""

from collections.abc import Iterator
from dataclasses import replace

from holozen.robot.errors import RobotError, cut, listed
from holozen.robot.model import RobotModel
from holozen.robot.sdf.frames import WORLD, Frames
from holozen.robot.sdf.include import Includes, Piece, version_of
from holozen.robot.sdf.members import register
from holozen.robot.sdf.tree import build
from holozen.robot.source import Source
from holozen.robot.tag import Tag, read_xml


def parse_sdf(root: Tag, source: Source) -> RobotModel:
    """The one robot in an `<sdf>`. Raises RobotError, also for a world, for several models, and for parts that no joint
    holds on the robot.
    """
    models = read_models(root, source)
    if len(models) > 1:
        names = listed([model.name for model in models])
        raise root.wrong(f"holds {len(models)} bodies that no joint holds together ({names}); a robot is one")
    return models[0]


def read_models(root: Tag | str, source: Source) -> list[RobotModel]:
    """The bodies in the `<sdf>` of an object or a robot, each with its `pose`; at least one.

    A model whose links no joint connects falls into several, which move freely; the one with the canonical link
    comes first and has the model's name. Raises RobotError.
    """
    if isinstance(root, str):
        root = read_xml(root, str(source.origin))
    if root.name != "sdf":
        raise root.wrong("is no <sdf>; an SDF file starts with <sdf version=...>")
    if root.first("world"):
        raise root.wrong("holds a <world>, not a robot or an object; give it to the simulator as --world")
    models = list(models_in(Piece(root, source, version_of(root)), Frames(), Includes()))
    if not models:
        raise root.wrong("has no <model> with a <link>")
    return [replace(models[0], warnings=tuple(source.warnings)), *models[1:]]


def models_in(outer: Piece, frames: Frames, includes: Includes) -> Iterator[RobotModel]:
    """The bodies directly inside an `<sdf>` or a `<world>`, in the order of the file. Raises RobotError."""
    families = [register(piece, WORLD, frames, includes) for piece in includes.within(outer)]
    names: dict[str, Tag] = {}
    for family in families:
        for model in build(family, frames):
            tag = family[0].piece.tag
            if model.name in names:
                raise _taken(tag, model.name)
            names[model.name] = tag
            yield model


def _taken(tag: Tag, name: str) -> RobotError:
    return tag.wrong(f"makes a body called {cut(name)}, which there is already; give each its own name")
