"""Joint states, which are joint commands too, and what sensors measure."""

from collections.abc import Sequence
from typing import Annotated, ClassVar

from msgspec import Meta, field

from holozen.messages.geometry_msgs import Quaternion, Vector3
from holozen.messages.message import Float32, Message, UInt8, UInt32
from holozen.messages.std_msgs import Header

# Publishers may assign an array, which is sent without checking each number.
Floats = Annotated[Sequence[float], Meta(extra={"ros": "float32[]"})]
Bytes = Annotated[Sequence[int], Meta(extra={"ros": "uint8[]"})]
Nine = Annotated[list[float], Meta(min_length=9, max_length=9)]
Twelve = Annotated[list[float], Meta(min_length=12, max_length=12)]


class JointState(Message):
    """Joint angles in rad (or metres) and rates in rad/s (or m/s), in the order of `name`."""

    header: Header = field(default_factory=Header)
    name: list[str] = field(default_factory=list)
    position: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)


class LaserScan(Message):
    """Ranges in m by angle in rad about z, counter-clockwise from x. Infinite: nothing within
    `range_max` (REP 117).
    """

    ANY_NUMBER: ClassVar[bool] = True
    header: Header = field(default_factory=Header)
    angle_min: Float32 = 0.0
    angle_max: Float32 = 0.0
    angle_increment: Float32 = 0.0
    time_increment: Float32 = 0.0
    scan_time: Float32 = 0.0
    range_min: Float32 = 0.0
    range_max: Float32 = 0.0
    ranges: Floats = field(default_factory=list)
    intensities: Floats = field(default_factory=list)


class Range(Message):
    """The distance in m to what is nearest in a cone about x of `field_of_view` rad. Infinite:
    nothing is near.
    """

    ANY_NUMBER: ClassVar[bool] = True
    ULTRASOUND: ClassVar[UInt8] = 0
    INFRARED: ClassVar[UInt8] = 1
    header: Header = field(default_factory=Header)
    radiation_type: UInt8 = 0
    field_of_view: Float32 = 0.0
    min_range: Float32 = 0.0
    max_range: Float32 = 0.0
    range: Float32 = 0.0
    variance: Float32 = 0.0


class Imu(Message):
    """Orientation in the world; rotation rate in rad/s and specific force in m/s^2 in the axes of
    the sensor. At rest the force points up, with 9.8 m/s^2. A covariance that begins with -1 marks
    a value that is not measured.
    """

    header: Header = field(default_factory=Header)
    orientation: Quaternion = field(default_factory=Quaternion)
    orientation_covariance: Nine = field(default_factory=lambda: [0.0] * 9)
    angular_velocity: Vector3 = field(default_factory=Vector3)
    angular_velocity_covariance: Nine = field(default_factory=lambda: [0.0] * 9)
    linear_acceleration: Vector3 = field(default_factory=Vector3)
    linear_acceleration_covariance: Nine = field(default_factory=lambda: [0.0] * 9)


class PointField(Message):
    """A number of each point: its name, place in bytes, type and count."""

    INT8: ClassVar[UInt8] = 1
    UINT8: ClassVar[UInt8] = 2
    INT16: ClassVar[UInt8] = 3
    UINT16: ClassVar[UInt8] = 4
    INT32: ClassVar[UInt8] = 5
    UINT32: ClassVar[UInt8] = 6
    FLOAT32: ClassVar[UInt8] = 7
    FLOAT64: ClassVar[UInt8] = 8
    name: str = ""
    offset: UInt32 = 0
    datatype: UInt8 = 0
    count: UInt32 = 0


class PointCloud2(Message):
    """Points in rows of `width`, each of `point_step` bytes that `fields` describe."""

    header: Header = field(default_factory=Header)
    height: UInt32 = 0
    width: UInt32 = 0
    fields: list[PointField] = field(default_factory=list)
    is_bigendian: bool = False
    point_step: UInt32 = 0
    row_step: UInt32 = 0
    data: Bytes = field(default_factory=list)
    is_dense: bool = False


class Image(Message):
    """Pixels in rows of `step` bytes, from the top; `encoding` as in
    sensor_msgs/image_encodings.hpp.
    """

    header: Header = field(default_factory=Header)
    height: UInt32 = 0
    width: UInt32 = 0
    encoding: str = ""
    is_bigendian: UInt8 = 0
    step: UInt32 = 0
    data: Bytes = field(default_factory=list)


class CompressedImage(Message):
    """A picture as a file of JPEG or PNG. `format` as in ROS's image_transport: `ENCODING; jpeg
    compressed bgr8`.
    """

    header: Header = field(default_factory=Header)
    format: str = ""
    data: Bytes = field(default_factory=list)


class RegionOfInterest(Message):
    """A part of an image in pixels; all zero: the whole."""

    x_offset: UInt32 = 0
    y_offset: UInt32 = 0
    height: UInt32 = 0
    width: UInt32 = 0
    do_rectify: bool = False


class CameraInfo(Message):
    """Of a pinhole camera: `k` (3 x 3) and `p` (3 x 4) by rows, in pixels; x right, y down, z
    forward.
    """

    header: Header = field(default_factory=Header)
    height: UInt32 = 0
    width: UInt32 = 0
    distortion_model: str = ""
    d: list[float] = field(default_factory=list)
    k: Nine = field(default_factory=lambda: [0.0] * 9)
    r: Nine = field(default_factory=lambda: [0.0] * 9)
    p: Twelve = field(default_factory=lambda: [0.0] * 12)
    binning_x: UInt32 = 0
    binning_y: UInt32 = 0
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)
