"""The poses and velocities of a robot's links, from those of its root and its joints. No engine, no
clock.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

from holozen.kinematics import velocity_at
from holozen.robot.model import Pose, RobotModel, descend
from holozen.robot.rigid import Frame, moved_by
from holozen.rotation import XYZ, XYZW, multiply, rotate


class LinkState(NamedTuple):
    """A frame in the world: position (m), rotation, velocity (m/s) and rotation rate (rad/s)."""

    xyz: XYZ
    rotation: XYZW
    linear: XYZ = (0.0, 0.0, 0.0)
    angular: XYZ = (0.0, 0.0, 0.0)

    def at(self, xyz: XYZ, rotation: XYZW) -> "LinkState":
        """The state of a frame that is fixed in this one, at a position (m) and rotation."""
        (x, y, z), (a, b, c) = self.xyz, rotate(self.rotation, xyz)
        along = velocity_at((a, b, c), self.linear, self.angular)
        return LinkState(
            (x + a, y + b, z + c), multiply(self.rotation, rotation), along, self.angular
        )


LinkStates = Mapping[str, LinkState]
"""The states of a robot's links, by name."""


class LinkTree:
    """The links of a model. `joints` has each joint, every parent before its children, with its
    position (m) and rotation in the parent link.
    """

    def __init__(self, model: RobotModel) -> None:
        self._root = model.root
        self.joints = [(joint, *placed(joint.pose)) for joint in descend(model.root, model.joints)]

    def states(
        self, root: LinkState, positions: Mapping[str, float] = {}, rates: Mapping[str, float] = {}
    ) -> dict[str, LinkState]:
        """The states of all links, from that of the root and the joints' positions (rad or m) and
        rates (rad/s or m/s). A joint that is not given stands at zero.
        """
        found = {self._root: root}
        for joint, xyz, rotation in self.joints:
            at = found[joint.parent].at(
                *moved_by(joint, xyz, rotation, positions.get(joint.name, 0.0))
            )
            if rate := rates.get(joint.name, 0.0):
                axis = rotate(at.rotation, joint.axis)
                if joint.kind == "prismatic":
                    at = at._replace(linear=_more(at.linear, axis, rate))
                else:
                    at = at._replace(angular=_more(at.angular, axis, rate))
            found[joint.child] = at
        return found


@lru_cache(64)
def link_tree(model: RobotModel) -> LinkTree:
    """The link tree of a model, which all robots of that model share."""
    return LinkTree(model)


def placed(pose: Pose) -> tuple[XYZ, XYZW]:
    """The position and rotation of a pose."""
    frame = Frame.of(pose)
    return frame.xyz, frame.quaternion


def _more(value: XYZ, axis: XYZ, rate: float) -> XYZ:
    return value[0] + rate * axis[0], value[1] + rate * axis[1], value[2] + rate * axis[2]
