"""What the robots of a command line need to be driven together."""

from collections.abc import Sequence
from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.robot.keys import command_key
from holozen.robot.model import RobotModel, driven, takes
from holozen.robot.rigid import advised_drive, lump


def drivable(model: RobotModel, path: Path, drive: str | None) -> RobotModel:
    """The robot of a file, with the `drive` of the flag if it takes one. Raises RobotError without
    a drive, or without a shape to stand on.
    """
    if drive and takes(model, drive):
        model = driven(model, drive)
    if model.drive is None:
        advice = "move the whole body: --drive planar_move"
        if advised_drive(model) == "omni":
            advice = f"drive its omni wheels: --drive omni; or {advice}"
        raise RobotError(f"{path}: no plugin drives it; add one, or {advice}")
    if not lump(model).collisions:
        raise RobotError(
            f"{path}: no collision shape to stand on; give a link a <box>, <cylinder>, <sphere> "
            "or <mesh>"
        )
    return model


def require_names(robots: Sequence[tuple[RobotModel, str]]) -> None:
    """Raise RobotError if two of the robots have the same name. Those without one may be told apart
    by the namespaces in their files.
    """
    names = [(name, command_key(model, name)) for model, name in robots]
    for name, key in names:
        if (same := names.count((name, key))) > 1:
            what = f"are called {name!r}" if name else "have no name"
            raise RobotError(f"{same} robots {what}; give each a name: --robot FILE=NAME")
