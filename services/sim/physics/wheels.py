"""Wheels: where they are on a robot, and how they turn as it moves. Those of a planar base turn
only visually.
"""

import math
from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from holozen.kinematics import Wheel, mecanum_rates, wheel_rate
from holozen.limits import Planar
from holozen.robot.model import HERE, Mecanum, RobotModel, Shape
from holozen.robot.rigid import (
    ROUND,
    Axis,
    Part,
    PlacedShape,
    joint_axes,
    radius_across,
    round_radius,
)
from holozen.robot.rotation import quaternion_of, triple

from .engine import UPRIGHT

FLAT = 0.1  # sine of the axle's angle to the ground; a steeper joint is not a wheel


class Wheels:
    """Angles (rad) and rates (rad/s) of the moving joints, in the order of `names`. Joints of no
    wheel stay at 0.
    """

    def __init__(self, model: RobotModel) -> None:
        self.names = list(joint_axes(model))
        wheels = {wheel.joint: wheel for wheel in rolling_wheels(model)}
        self._wheels = [wheels.get(name) for name in self.names]
        self.angles = [0.0] * len(self.names)
        self.rates = [0.0] * len(self.names)

    def roll(self, velocity: Planar, dt: float) -> None:
        """Roll for `dt` seconds at the body-frame `velocity`."""
        self.rates = self._rates(velocity)
        self.angles = [
            angle + rate * dt for angle, rate in zip(self.angles, self.rates, strict=True)
        ]

    def _rates(self, velocity: Planar) -> list[float]:
        return [wheel_rate(velocity, wheel) if wheel else 0.0 for wheel in self._wheels]


class MecanumWheels(Wheels):
    """Four wheels with rollers at 45 degrees that are not links of the file."""

    def __init__(self, model: RobotModel, mechanism: Mecanum) -> None:
        super().__init__(model)
        self._driven = (
            mechanism.front_left,
            mechanism.front_right,
            mechanism.back_left,
            mechanism.back_right,
        )
        self._arm, self._radius = (mechanism.separation + mechanism.wheelbase) / 2, mechanism.radius
        self._signs = [forward_sign(model, name) for name in self._driven]

    def _rates(self, velocity: Planar) -> list[float]:
        turning = mecanum_rates(velocity, self._arm, self._radius)
        rates = {
            name: sign * rate
            for name, sign, rate in zip(self._driven, self._signs, turning, strict=True)
        }
        return [rates.get(name, 0.0) for name in self.names]


def rolling_wheels(model: RobotModel) -> list[Wheel]:
    """The wheels of a model: continuous joints with a level axle and a round collision shape, or
    with rollers. A joint that is carried by a wheel is no wheel.
    """
    turning = {
        name: axis
        for name, axis in joint_axes(model).items()
        if model.joints[name].kind == "continuous"
    }
    carried = {name: model.joints[name].parent for name in turning}
    rims = {model.joints[name].child for name in turning}
    rollers: dict[str, list[str]] = {}
    for name, carrier in carried.items():
        if carrier in rims:
            rollers.setdefault(carrier, []).append(name)
    return [
        wheel
        for name, axis in turning.items()
        if carried[name] not in rims
        and (wheel := _wheel(model, name, axis, rollers.get(model.joints[name].child)))
    ]


def has_rollers(model: RobotModel, wheel: Wheel) -> bool:
    """Whether links turn on a wheel, as rollers on its rim."""
    return any(
        model.joints[name].parent == model.joints[wheel.joint].child for name in joint_axes(model)
    )


def on_spheres(parts: list[Part], wheels: Sequence[Wheel]) -> list[Part]:
    """The parts, with a sphere in place of each wheel: it touches the ground at a point below the
    axle, as a wheel with rollers on its rim does. One of its principal axes is the axle.
    """
    radii = {wheel.joint: wheel.radius for wheel in wheels}
    return [
        _on_sphere(part, radii[part.joint.name])
        if part.joint and part.joint.name in radii
        else part
        for part in parts
    ]


def _on_sphere(part: Part, radius: float) -> Part:
    assert part.joint is not None, "a wheel turns on a joint"
    body, axle = part.body, part.joint.axis
    aside = min(
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        key=lambda axis: abs(float(np.dot(axis, axle))),
    )
    along = np.cross(aside, axle) / np.linalg.norm(np.cross(aside, axle))
    axes = np.stack([along, np.array(axle), np.cross(along, axle)], axis=1)
    inertia = triple([body.moment(triple(axis)) for axis in axes.T])
    sphere = PlacedShape(part.link, Shape("sphere", (radius,), HERE), (0.0, 0.0, 0.0), UPRIGHT)
    return replace(
        part, body=replace(body, inertia=inertia, axes=quaternion_of(axes), collisions=(sphere,))
    )


def forward_sign(model: RobotModel, joint: str) -> float:
    """1 if a positive rate of a wheel rolls the robot forward, since its axis points left; else
    -1.
    """
    return -1.0 if joint_axes(model)[joint].direction[1] < 0 else 1.0


def _wheel(model: RobotModel, name: str, axis: Axis, rollers: list[str] | None) -> Wheel | None:
    length = math.hypot(axis.direction[0], axis.direction[1])
    radius, skew = (
        _rim(model, axis, rollers)
        if rollers
        else (round_radius(model.links[model.joints[name].child]), 0.0)
    )
    if not radius or abs(axis.direction[2]) > FLAT:
        return None
    ax, ay = axis.direction[0] / length, axis.direction[1] / length
    return Wheel(name, axis.xyz[0], axis.xyz[1], ax, ay, radius, skew)


def _rim(model: RobotModel, wheel: Axis, rollers: list[str]) -> tuple[float, float]:
    """The radius (m) of a wheel with rollers, from its axle to the outside of a roller at its
    middle; and its skew. Both are 0 if the rollers have no shapes, or cannot roll.
    """
    axis, link = joint_axes(model)[rollers[0]], model.links[model.joints[rollers[0]].child]
    along, axle = np.array(axis.direction), np.array(wheel.direction)
    # along the radius to the point of the roller's axis that is nearest to the axle
    out = np.cross(along, axle)
    radii = [shape.size[0] for shape in link.collisions if shape.kind in ROUND]
    thick = max(radii, default=radius_across(link, model.joints[rollers[0]].axis))
    sine = float(np.linalg.norm(out))
    if sine < FLAT or not thick:
        return 0.0, 0.0
    away = float((np.array(axis.xyz) - np.array(wheel.xyz)) @ out) / sine
    # At the lowest point of the wheel the radius points down, and axle x up is the rolling
    # direction: radius x axle.
    forward = float(along @ np.cross(out, axle)) / sine
    # A roller is straight: away from its middle, the share of its axis in the rolling direction
    # shrinks by the cosine of the angle on the rim. This is the mean over the roller's part of the
    # rim.
    half = math.pi / max(len(rollers), 3)
    mean = math.asinh(math.tan(half)) / half
    return abs(away) + thick, mean * float(along @ axle) / forward * math.copysign(1.0, away)
