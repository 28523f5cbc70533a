"""What a renderer makes, and what all of them draw alike."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holozen.robot.model import Pose, Shape

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]

GREY = (0.7, 0.7, 0.7, 1.0)  # Gazebo's grey, for shapes without a colour
WIDE, THICK = 200.0, 0.02  # m; width and thickness of the ground
GROUND = Shape("box", (WIDE, WIDE, THICK), Pose((0.0, 0.0, -THICK / 2)), color=(0.6, 0.6, 0.6, 1.0))


class Picture(NamedTuple):
    """Colours (height, width, 3), and the depth (height, width) along the view in m, infinite where
    nothing is.
    """

    colors: Bytes
    depth: Floats
