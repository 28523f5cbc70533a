"""Where the links of a robot are and how they move, by its root and its joints: no engine, no clock."""

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

from holozen.robot.model import Joint, Pose, RobotModel, descend
from holozen.robot.rigid import Frame, moved_by
from holozen.rotation import XYZ, XYZW, multiply, rotate


class LinkState(NamedTuple):
    """A frame in the world: position (m), rotation, velocity (m/s) and rotation rate (rad/s)."""

    xyz: XYZ
    rotation: XYZW
    linear: XYZ = (0.0, 0.0, 0.0)
    angular: XYZ = (0.0, 0.0, 0.0)

    def at(self, xyz: XYZ, rotation: XYZW) -> "LinkState":
        """The motion of a frame that is fixed in this one."""
        (x, y, z), (a, b, c), (u, v, w) = self.xyz, rotate(self.rotation, xyz), self.angular
        along = (self.linear[0] + v * c - w * b, self.linear[1] + w * a - u * c, self.linear[2] + u * b - v * a)
        return LinkState((x + a, y + b, z + c), multiply(self.rotation, rotation), along, self.angular)


class LinkTree:
    """The links of a model, every parent before its children."""

    def __init__(self, model: RobotModel) -> None:
        above = {joint.child: joint for joint in model.joints.values()}
        self._root = model.root
        self._joints: list[tuple[Joint, XYZ, XYZW]] = []
        for name in list(descend(model.root, model.joints))[1:]:
            frame = Frame.of(above[name].pose)
            self._joints.append((above[name], frame.xyz, frame.quaternion))

    def states(
        self, root: LinkState, positions: Mapping[str, float] = {}, rates: Mapping[str, float] = {}
    ) -> dict[str, LinkState]:
        """Each link's, from those of the root and of the joints (rad or m; per s); a joint that is not given is at
        zero, and still.
        """
        found = {self._root: root}
        for joint, xyz, rotation in self._joints:
            at = found[joint.parent].at(*moved_by(joint, xyz, rotation, positions.get(joint.name, 0.0)))
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
    """The links of a model, which its copies share."""
    return LinkTree(model)


def placed(pose: Pose) -> tuple[XYZ, XYZW]:
    """The position and rotation of a pose."""
    frame = Frame.of(pose)
    return frame.xyz, frame.quaternion


def _more(value: XYZ, axis: XYZ, rate: float) -> XYZ:
    return value[0] + rate * axis[0], value[1] + rate * axis[1], value[2] + rate * axis[2]
