"""The collision monitor of a robot of the sim, by what its file says of its shape and sensors."""

from holozen.command.collision_monitor import CollisionMonitor
from holozen.robot.model import Pose, RobotModel, is_watched
from holozen.robot.rigid import Frame, footprint_radius, link_frames, turning_point
from holozen.wire import key_for

from .identity import Identity


def monitor_for(identity: Identity) -> CollisionMonitor | None:
    """The monitor of a robot; None if it does not drive, or has no lidar or distance sensor."""
    model = identity.model
    drive, sensors = model.drive, _sensors(model, identity.prefix)
    if drive is None or not identity.drives or not sensors:
        return None
    radius = footprint_radius(model)
    return CollisionMonitor(radius, sensors, drive.time_before_collision) if radius else None


def _sensors(model: RobotModel, prefix: str) -> dict[str, Pose]:
    """The keys of its scans and ranges, each with the sensor's pose from where the robot turns."""
    frames, (x, y, z) = link_frames(model), turning_point(model)
    origin = Frame.of(Pose((x, y, z))).inverse
    return {
        key_for(sensor.topic, prefix): (origin @ frames[sensor.link] @ Frame.of(sensor.pose)).pose
        for sensor in model.sensors
        if is_watched(sensor)
    }
