"""World files: what the simulator starts with. The library reads them, so that `holozen check` can too."""

from collections.abc import Mapping
from pathlib import Path

from holozen.robot.errors import RobotError as WorldError
from holozen.robot.sdf.world import GRAVITY, STEP, WorldSpec

__all__ = ["GRAVITY", "STEP", "WorldError", "WorldSpec", "load"]


def load(path: Path, packages: Mapping[str, Path] = {}) -> WorldSpec:
    """The world in an SDF file; `packages` as for robots. Raises WorldError naming file and line."""
    # With numpy in it; `--help` should not wait for that.
    from holozen.robot.sdf.world_file import load_world

    return load_world(path, packages)
