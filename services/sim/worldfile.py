"""World files: what the simulator starts with. The reading is the library's, so that `holozen check` reads them too."""

from holozen.robot.errors import RobotError as WorldError
from holozen.robot.world import GRAVITY, STEP, WorldSpec
from holozen.robot.world import load_world as load

__all__ = ["GRAVITY", "STEP", "WorldError", "WorldSpec", "load"]
