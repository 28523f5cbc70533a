"""How a robot is driven: the mechanism that a Twist goes to, and the keys it comes and goes on."""

import math
from dataclasses import dataclass

from holozen.wire import COMMAND_SILENCE


@dataclass(frozen=True, slots=True)
class Planar:
    """The whole robot moves over the plane at the commanded body-frame velocity: planar_move, VelocityControl."""


@dataclass(frozen=True, slots=True)
class Differential:
    """Wheels on two sides: linear.x and angular.z count, linear.y is ignored. With four or more it is a skid-steer.

    `left` and `right` name joints. `separation` between the sides and `radius` of the wheels are in metres; 0: as the
    robot's own links have them. `torque` in N m is the most that a wheel's motor gives, `acceleration` in m/s^2 the
    most by which a wheel's rim speeds up or slows down. `encoder` is true where odometry adds up the wheels' turns,
    false where it tells the true pose.
    """

    left: tuple[str, ...]
    right: tuple[str, ...]
    separation: float = 0.0
    radius: float = 0.0
    torque: float = math.inf
    encoder: bool = True
    acceleration: float = math.inf


@dataclass(frozen=True, slots=True)
class Mecanum:
    """Four wheels with rollers at 45 degrees. Joints by their place; metres; 0: as the robot's own links have them.
    `encoder` as for Differential.
    """

    front_left: str
    front_right: str
    back_left: str
    back_right: str
    separation: float = 0.0
    wheelbase: float = 0.0
    radius: float = 0.0
    encoder: bool = True


@dataclass(frozen=True, slots=True)
class Balancing:
    """Two wheels that hold the body upright while it drives: wheely_boi."""

    left: str = "jointL"
    right: str = "jointR"


Mechanism = Planar | Differential | Mecanum | Balancing


def joints_of(mechanism: Mechanism) -> tuple[str, ...]:
    """The joints that a mechanism turns."""
    match mechanism:
        case Planar():
            return ()
        case Differential():
            return *mechanism.left, *mechanism.right
        case Mecanum():
            return mechanism.front_left, mechanism.front_right, mechanism.back_left, mechanism.back_right
        case Balancing():
            return mechanism.left, mechanism.right


@dataclass(frozen=True, slots=True)
class Drive:
    """What a drive hears and tells.

    All defaults but the timeout are those of Gazebo's planar_move.
    Topics have their namespace before them and no slash at the front. `odometry_rate` in Hz of sim time.
    `robot_base_frame` names a link, the child frame of odometry. `command_timeout` in seconds; -1 switches it
    off. `covariance` is the variance of x and y in m^2 and of yaw in rad^2. The limits are those of the file, in m/s,
    rad/s, m/s^2 and rad/s^2.
    """

    command_topic: str = "cmd_vel"
    odometry_topic: str = "odom"
    odometry_frame: str = "odom"
    odometry_rate: float = 20.0
    robot_base_frame: str = ""
    command_timeout: float = COMMAND_SILENCE
    publish_odom: bool = True
    publish_odom_tf: bool = True
    covariance: tuple[float, float, float] = (1e-5, 1e-5, 1e-3)
    mechanism: Mechanism = Planar()
    max_linear: float = math.inf
    max_angular: float = math.inf
    max_linear_acceleration: float = math.inf
    max_angular_acceleration: float = math.inf
