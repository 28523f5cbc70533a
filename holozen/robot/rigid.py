"""A robot as one rigid body, all joints at zero: mass, inertia, and where each part is."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from holozen.robot.errors import RobotError, cut
from holozen.robot.model import RobotModel
from holozen.robot.parts import Inertial, Link, Pose, Shape
from holozen.robot.rotation import Array, Quaternion, matrix_of, principal, quaternion_of, rpy_of, symmetric, triple
from holozen.robot.shapes import solid
from holozen.robot.solids import is_absurd, moments
from holozen.robot.tag import Vector
from holozen.robot.tree import descend

SMALLEST_MASS = 1e-6  # kg; an engine divides by the mass
SMALLEST_GYRATION = 1e-3  # m; and by the moments of inertia, of which a point mass would have none


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """A frame in another one: `position` (3,) in metres, `rotation` (3, 3) whose columns are its axes."""

    position: Array
    rotation: Array

    @classmethod
    def of(cls, pose: Pose) -> "Frame":
        """The frame of a URDF pose."""
        return cls(np.array(pose.xyz), matrix_of(pose.rpy))

    def __matmul__(self, inner: "Frame") -> "Frame":
        """`inner`, which is told in this frame, in the frame that this one is told in."""
        return Frame(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    @property
    def inverse(self) -> "Frame":
        """The outer frame as this one sees it."""
        back = self.rotation.T
        return Frame(-(back @ self.position), back)

    @property
    def pose(self) -> Pose:
        """The frame as a URDF pose."""
        return Pose(self.xyz, rpy_of(self.rotation))

    @property
    def xyz(self) -> Vector:
        """The position in metres."""
        return triple(self.position)

    @property
    def quaternion(self) -> Quaternion:
        """The rotation as x, y, z, w."""
        return quaternion_of(self.rotation)


@dataclass(frozen=True, slots=True)
class Axis:
    """A joint at zero in the root frame: its origin in metres and the unit vector it turns about or slides on."""

    xyz: Vector
    direction: Vector


@dataclass(frozen=True, slots=True)
class PlacedShape:
    """A collision shape of `link`; position in metres and quaternion x, y, z, w in the root frame."""

    link: str
    shape: Shape
    xyz: Vector
    quaternion: Quaternion


@dataclass(frozen=True, slots=True)
class Body:
    """One rigid body in the root frame.

    `mass` in kg, `centre` of mass in metres, principal moments `inertia` in kg m^2 about it, and their axes
    as the quaternion x, y, z, w `axes`, which turns the principal frame into the root frame.
    """

    mass: float
    centre: Vector
    inertia: Vector
    axes: Quaternion
    collisions: tuple[PlacedShape, ...]


def link_frames(model: RobotModel) -> dict[str, Frame]:
    """Link name -> its frame in the root frame, parents first."""
    above = {joint.child: joint for joint in model.joints.values()}
    frames = {model.root: Frame.of(Pose())}
    for name in list(descend(model.root, model.joints))[1:]:
        frames[name] = frames[above[name].parent] @ Frame.of(above[name].pose)
    return frames


def joint_axes(model: RobotModel) -> dict[str, Axis]:
    """Joint name -> its axis in the root frame, for the joints that turn or slide."""
    frames = link_frames(model)
    moving = [joint for joint in model.joints.values() if joint.kind in ("continuous", "revolute", "prismatic")]
    return {
        joint.name: Axis(frames[joint.child].xyz, triple(frames[joint.child].rotation @ np.array(joint.axis)))
        for joint in moving
    }


def lump(model: RobotModel) -> Body:
    """All links as one body, as Gazebo lumps links over fixed joints.

    A link without mass only lends its shapes. Raises RobotError for a robot without mass.
    """
    body = lump_links(model, link_frames(model))
    if body.mass < SMALLEST_MASS and not model.static:
        problem = f"robot {cut(model.name)} has a mass of {body.mass} kg"
        raise RobotError(f"{problem}; give a link an <inertial> with a <mass> of {SMALLEST_MASS} kg or more")
    return body


def lump_links(model: RobotModel, frames: Mapping[str, Frame]) -> Body:
    """The links named by `frames` as one body, in the frame that `frames` are told in. Its moments of inertia are those
    of its shapes where its own are far below them: an engine makes what turns so easily spin.
    """
    links = [model.links[name] for name in frames]
    parts = [(frames[link.name] @ Frame.of(link.inertial.pose), link.inertial) for link in links if link.inertial]
    mass, centre, inertia = _sum(parts)
    principals, axes = principal(_not_absurd(inertia, mass, links, frames))
    principals = np.maximum(principals, mass * SMALLEST_GYRATION**2)
    return Body(mass, triple(centre), triple(principals), quaternion_of(axes), tuple(_collisions(links, frames)))


def _not_absurd(inertia: Array, mass: float, links: list[Link], frames: Mapping[str, Frame]) -> Array:
    placed = [(shape, frames[link.name] @ Frame.of(shape.pose)) for link in links for shape in link.collisions]
    least = moments((shape, frame.position, frame.rotation) for shape, frame in placed)
    return inertia if least is None or not is_absurd(inertia, mass, least) else mass * least


def _sum(parts: list[tuple[Frame, Inertial]]) -> tuple[float, Array, Array]:
    """Mass, centre (3,) and tensor (3, 3) about it, by the parallel axis theorem."""
    mass = sum((part.mass for _, part in parts), 0.0)
    moment = sum((part.mass * frame.position for frame, part in parts), np.zeros(3))
    centre = moment / mass if mass > 0 else moment
    inertia = np.zeros((3, 3))
    for frame, part in parts:
        away = frame.position - centre
        inertia += frame.rotation @ symmetric(part.inertia) @ frame.rotation.T
        inertia += part.mass * (away @ away * np.eye(3) - np.outer(away, away))
    return mass, centre, inertia


def _collisions(links: list[Link], frames: Mapping[str, Frame]) -> Iterable[PlacedShape]:
    for link in links:
        for shape in link.collisions:
            frame = frames[link.name] @ Frame.of(shape.pose)
            yield PlacedShape(link.name, solid(shape), frame.xyz, frame.quaternion)
