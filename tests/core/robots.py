"""Robots of a few tags, read as from a file."""

from pathlib import Path

from holozen.robot.files.loading import parse
from holozen.robot.model import Drive, RobotModel

ORIGIN = Path("somewhere/robot.urdf")


def robot(*parts: str) -> RobotModel:
    """A robot of these tags, the first of which is on line 2."""
    return parse(f'<robot name="r">\n{"".join(parts)}</robot>', ORIGIN)


def drive_of(model: RobotModel) -> Drive:
    """The drive of a robot whose file nothing is to be said of."""
    assert model.drive is not None and model.warnings == ()
    return model.drive
