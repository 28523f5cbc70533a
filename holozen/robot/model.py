"""The contents of robot and world files as plain data: links, joints, drives, robots and worlds."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from holozen.wire import COMMAND_SILENCE

Vector = tuple[float, float, float]


class Pose(Struct, frozen=True):
    """A frame in its parent frame: metres, and radians of roll, pitch, yaw about the parent's fixed
    x, y, z.
    """

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


Moments = tuple[float, float, float, float, float, float]
"""A tensor of inertia: ixx, ixy, ixz, iyy, iyz, izz."""


class Inertial(Struct, frozen=True):
    """Mass in kg, and moments of inertia in kg m^2 about the centre of mass, in the axes of `pose`.

    `pose` is the inertial frame in the link's. The tensor is positive definite, or all zero for a
    point mass.
    """

    pose: Pose
    mass: float
    inertia: Moments


Color = tuple[float, float, float, float]
"""Red, green, blue, alpha, each from 0 to 1."""


class Shape(Struct, frozen=True):
    """A visual or collision shape; `pose` is its frame in the link's.

    `size` in metres by `kind`: "box" x, y, z; "cylinder" radius, length (along z); "sphere" radius;
    "plane" x, y (its normal is z); "mesh" the three scale factors; "hull" nothing. `path` is a
    mesh's file, None if it was not found; `data` is the file itself as a data: URI, if the text
    held it, or the file names textures, which it then includes. `texture` is an image as a data:
    URI, which is drawn on the shape. `points` in metres define a "hull" as their convex hull.
    `triangles` are the corners (n, 3, 3) in metres, as 32-bit floats, of a collision mesh that does
    not move and is not convex: it collides as it is.
    """

    kind: str
    size: tuple[float, ...]
    pose: Pose
    path: Path | None = None
    color: Color | None = None
    points: tuple[Vector, ...] = ()
    data: str = ""
    texture: str = ""
    triangles: bytes = b""


def solid(shape: Shape) -> Shape:
    """The shape for the sim: the convex hull of a collision mesh that was found; others
    unchanged.
    """
    return replace(shape, kind="hull", size=()) if shape.kind == "mesh" and shape.points else shape


class Surface(Struct, frozen=True):
    """Contact parameters of a link's collision shapes: friction coefficients (mu2 across mu1),
    stiffness in N/m and damping in N s/m. None: the simulator's default.
    """

    mu1: float | None = None
    mu2: float | None = None
    kp: float | None = None
    kd: float | None = None
    self_collide: bool = False


class Link(Struct, frozen=True):
    """A rigid part. Without an `inertial` it has no mass."""

    name: str
    inertial: Inertial | None
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]
    surface: Surface = Surface()
    gravity: bool = True


class Limits(Struct, frozen=True):
    """Effort in N or N m, velocity in m/s or rad/s, position in m or rad; infinite if the file sets
    none.
    """

    effort: float = math.inf
    velocity: float = math.inf
    lower: float = -math.inf
    upper: float = math.inf


class Mimic(Struct, frozen=True):
    """A joint that follows another one: multiplier * position + offset."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


class Joint(Struct, frozen=True):
    """`kind` is one of `JOINT_KINDS`. `pose` is the child link's frame in the parent's at joint
    position zero; `axis` is a unit vector in the child's frame, (1, 0, 0) if the kind has none.
    `friction` is Coulomb friction, in N m or N; `damping` in N m s/rad or N s/m.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: Vector
    limits: Limits
    friction: float = 0.0
    damping: float = 0.0
    mimic: Mimic | None = None


# the kinds that are simulated; the others are treated as fixed
MOVING = ("continuous", "revolute", "prismatic")
JOINT_KINDS = (*MOVING, "fixed", "floating", "planar")


class Force(Struct, frozen=True):
    """Messages on `topic` push a link, at its centre of mass; along the link's axes if `in_link`,
    else the world's.

    The topic includes its namespace and has no leading slash.
    """

    link: str
    topic: str
    in_link: bool = False


class Pushed(Struct, frozen=True, tag=True):
    """The model is moved by its forces alone; cmd_vel has no effect."""


class Planar(Struct, frozen=True, tag=True):
    """The whole robot moves over the plane at the commanded body-frame velocity: planar_move,
    VelocityControl.

    Beside forces that push the robot, it stops them `update_rate` times a second of sim time; 0: at
    each step.
    """

    update_rate: float = 20.0


class Differential(Struct, frozen=True, tag=True):
    """Wheels on two sides: linear.x and angular.z are used, linear.y is ignored. Four or more make
    a skid-steer.

    `left` and `right` name joints. `separation` between the sides and `radius` of the wheels are in
    metres; 0: not measured yet. `torque` in N m is the maximum of a wheel's motor, `acceleration`
    in m/s^2 the maximum acceleration and deceleration of a wheel's rim. `encoder` is true if
    odometry integrates the wheels' rotation, false if it is the true pose.
    """

    left: tuple[str, ...]
    right: tuple[str, ...]
    separation: float = 0.0
    radius: float = 0.0
    torque: float = math.inf
    encoder: bool = True
    acceleration: float = math.inf


class Mecanum(Struct, frozen=True, tag=True):
    """Four wheels with rollers at 45 degrees: the joint of each, and lengths in metres; 0: not
    measured yet. `encoder` as for Differential.
    """

    front_left: str
    front_right: str
    back_left: str
    back_right: str
    separation: float = 0.0
    wheelbase: float = 0.0
    radius: float = 0.0
    encoder: bool = True

    @property
    def left(self) -> tuple[str, ...]:
        """The joints on the left."""
        return self.front_left, self.back_left

    @property
    def right(self) -> tuple[str, ...]:
        """The joints on the right."""
        return self.front_right, self.back_right


class Omni(Struct, frozen=True, tag=True):
    """Three or more omni or mecanum wheels: it moves in any direction. The wheels are the
    continuous joints with a level axle that carry rollers; if there are none, those with a round
    collision shape. `encoder` as for Differential.
    """

    encoder: bool = False


class Balancing(Struct, frozen=True, tag=True):
    """Two wheels that balance the body while it drives: wheely_boi."""

    left: str = "jointL"
    right: str = "jointR"


PLANAR = Planar()
Mechanism = Planar | Differential | Mecanum | Omni | Balancing | Pushed


def sides_of(mechanism: Mechanism) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The joints that a mechanism turns, on the left and on the right."""
    match mechanism:
        case Planar() | Omni() | Pushed():
            return (), ()
        case Balancing():
            return (mechanism.left,), (mechanism.right,)
    return mechanism.left, mechanism.right


class Drive(Struct, frozen=True):
    """A drive: its topics, rates and limits.

    All defaults except the timeout are those of Gazebo's planar_move. Topics include their
    namespace and have no leading slash. `odometry_rate` in Hz of sim time. `robot_base_frame` names
    a link, the child frame of odometry. `command_timeout` in seconds; None disables it.
    `covariance` is the variance of x and y in m^2 and of yaw in rad^2. Odometry is the pose in the
    world, or with `odometry_from_start` relative to where the robot started; `odometry_noise` is
    the standard deviation of the noise on x, y, yaw and their rates, in m, rad, m/s and rad/s. The
    limits are those of the file, in m/s, rad/s, m/s^2 and rad/s^2. The robot slows down for what
    its lidars see `time_before_collision` s ahead; 0: it does not.
    """

    command_topic: str = "cmd_vel"
    odometry_topic: str = "odom"
    odometry_frame: str = "odom"
    odometry_rate: float = 20.0
    robot_base_frame: str = ""
    command_timeout: float | None = COMMAND_SILENCE
    publish_odom: bool = True
    publish_odom_tf: bool = True
    covariance: tuple[float, float, float] = (1e-5, 1e-5, 1e-3)
    odometry_from_start: bool = False
    odometry_noise: float = 0.0
    mechanism: Mechanism = PLANAR
    max_linear: float = math.inf
    max_angular: float = math.inf
    max_linear_acceleration: float = math.inf
    max_angular_acceleration: float = math.inf
    time_before_collision: float = 0.0


class Noise(Struct, frozen=True):
    """Gaussian noise, in the unit of what it is added to."""

    mean: float = 0.0
    stddev: float = 0.0


NO_NOISE = Noise()


class Fan(Struct, frozen=True):
    """`count` angles in rad, evenly spaced from `first` to `last`."""

    first: float = 0.0
    last: float = 0.0
    count: int = 1

    @property
    def step(self) -> float:
        """The angle in rad from one to the next; 0 for a single one."""
        return (self.last - self.first) / (self.count - 1) if self.count > 1 else 0.0


class Lidar(Struct, frozen=True, tag=True):
    """Rays from `near` to `far` metres, at angles to the left of x and upwards. `noise` is added to
    the ranges. `message` is "scan", "points", or "range": the nearest of all rays, of an `infrared`
    or an ultrasonic sensor.
    """

    horizontal: Fan
    vertical: Fan
    near: float
    far: float
    noise: Noise = NO_NOISE
    message: str = "scan"
    infrared: bool = True


class Imu(Struct, frozen=True, tag=True):
    """Noise on x, y, z of the angular velocity (rad/s) and of the linear acceleration (m/s^2).
    `oriented`: whether the orientation is measured too.
    """

    rate: tuple[Noise, Noise, Noise] = (NO_NOISE,) * 3
    acceleration: tuple[Noise, Noise, Noise] = (NO_NOISE,) * 3
    oriented: bool = True


class Bumper(Struct, frozen=True, tag=True):
    """Reports what touches the link."""


class Camera(Struct, frozen=True, tag=True):
    """A pinhole camera that looks along x, y to the left of its picture; `width` and `height` in
    pixels, `field_of_view` across the width in rad, `near` and `far` in m. `encoding` is "rgb8" or
    "mono8"; `noise` is that of a pixel value from 0 to 1. Pictures, their CameraInfo and depth are
    published on the keys `image`, `info` and `depth`, unless empty.
    """

    width: int
    height: int
    field_of_view: float
    near: float
    far: float
    image: str
    info: str
    depth: str = ""
    encoding: str = "rgb8"
    noise: Noise = NO_NOISE

    @property
    def compressed(self) -> str:
        """The key of its pictures as JPEG; empty if it publishes no pictures."""
        return self.image and f"{self.image}/compressed"


class Sensor(Struct, frozen=True):
    """A sensor at `pose` on `link`. Its measurements are published on `topic`, which includes its
    namespace and has no leading slash, at `rate` in Hz of sim time, in `frame`: a link, or a frame
    of its own at `mount` on its link.
    """

    name: str
    link: str
    pose: Pose
    frame: str
    mount: Pose | None
    topic: str
    rate: float
    device: Lidar | Imu | Bumper | Camera

    @property
    def topics(self) -> tuple[str, ...]:
        """All its keys."""
        camera = self.device
        keys = (
            (camera.image, camera.compressed, camera.info, camera.depth)
            if isinstance(camera, Camera)
            else ()
        )
        return (self.topic, *(key for key in keys if key and key != self.topic))


def is_watched(sensor: Sensor) -> bool:
    """Whether a collision monitor drives by that sensor: it publishes a scan, or a range."""
    return isinstance(sensor.device, Lidar) and sensor.device.message in ("scan", "range")


HERE = Pose()
MAX_PARTS = 1000  # links, and joints; far beyond what an engine simulates in real time


class RobotModel(Struct, frozen=True, eq=False):
    """A tree of links from `root`, in file order. Compared by identity, so that results cached for
    a model serve all its copies in a fleet.

    `drive` is None for a robot without a drive plugin. Each of `warnings` is a line that names
    file, line, element and what was done instead. A `static` model never moves. `pose` is the one
    that the file itself gives (SDF).
    """

    name: str
    root: str
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    drive: Drive | None
    warnings: tuple[str, ...] = ()
    static: bool = False
    pose: Pose = HERE
    forces: tuple[Force, ...] = ()
    sensors: tuple[Sensor, ...] = ()


def takes(model: RobotModel, drive: str) -> bool:
    """Whether `--drive` applies to a model: it has no drive, or its planar_move is to be done by
    omni wheels.
    """
    return model.drive is None or (drive == "omni" and isinstance(model.drive.mechanism, Planar))


def driven(model: RobotModel, drive: str) -> RobotModel:
    """The model with the drive that `--drive` names (planar_move or omni) on its root, if it
    `takes` one.
    """
    if not takes(model, drive):
        return model
    mechanism = Omni() if drive == "omni" else Planar()
    return replace(
        model, drive=replace(model.drive or Drive(robot_base_frame=model.root), mechanism=mechanism)
    )


STEP = 1 / 240  # s
GRAVITY = (0.0, 0.0, -9.8)  # m/s^2; Gazebo's default


class WorldSpec(Struct, frozen=True):
    """A world: physics step in s, gravity in m/s^2, real-time factor, and warnings.

    `ground`: whether there is a level plane at z = 0. `models` are all others, each with its `pose`
    in the world; a plane that is tilted or at another height is a static one.
    """

    name: str = "default"
    step: float = STEP
    gravity: Vector = GRAVITY
    rtf: float = 1.0
    ground: bool = False
    warnings: tuple[str, ...] = ()
    models: tuple[RobotModel, ...] = ()


J = TypeVar("J", bound=Any)  # has a `parent` and a `child`


def descend(root: str, joints: Mapping[str, J]) -> Iterator[J]:
    """The joints below the link `root`, in which those to a link come before those below it."""
    below: dict[str, list[J]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    waiting = [*below.get(root, ())]
    while waiting:
        joint = waiting.pop()
        yield joint
        waiting += below.get(joint.child, ())
