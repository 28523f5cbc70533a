"""The keys of a robot on the wire."""

from holozen.robot.model import Balancing, RobotModel
from holozen.wire import key_for

OF_ALL = {
    "tf": "its tf",
    "joint_states": "its joint states",
    "joint_command": "commands for its joints",
    "stop": "the service stop",
    "release": "the service release",
    "resume": "the service resume",
}
"""Key -> what is there, for every robot."""


def command_key(model: RobotModel, prefix: str) -> str:
    """The command key of a robot with this `prefix`. All its other keys but odometry are in the
    same namespace.
    """
    return key_for(model.drive.command_topic if model.drive else "cmd_vel", prefix)


def aliases(model: RobotModel, prefix: str) -> tuple[str, ...]:
    """Additional command keys: wheely_boi's plugin listens on `NAME/NAME/cmd`."""
    name = prefix or model.name
    return (
        (f"{name}/{name}/cmd",)
        if model.drive and isinstance(model.drive.mechanism, Balancing)
        else ()
    )


def keys_of(model: RobotModel, prefix: str) -> list[tuple[str, str]]:
    """All keys of a robot with this `prefix`, each with what is there. No other robot may have any
    of them.
    """
    command = command_key(model, prefix)
    namespace = command.rpartition("/")[0]
    keys = [(key_for(key, namespace), what) for key, what in OF_ALL.items()]
    if model.drive:
        keys += [(command, "its commands"), (f"{command}_status", "the status of its commands")]
        keys += [(key_for(model.drive.odometry_topic, prefix), "its odometry")]
        keys += [(key, "its commands") for key in aliases(model, prefix)]
    keys += [
        (key_for(topic, prefix), "a sensor") for sensor in model.sensors for topic in sensor.topics
    ]
    return keys + [
        (key, "a force")
        for key in dict.fromkeys(key_for(force.topic, prefix) for force in model.forces)
    ]


def shared(model: RobotModel, prefix: str) -> tuple[str, str]:
    """The first key on which a robot's file puts two things, and a line about it; both are empty if
    there is none.
    """
    found: dict[str, str] = {}
    for key, what in keys_of(model, prefix):
        if key in found:
            both = f"{found[key]} and {what} on one key, {key[:80]!r}"
            return key, f"the robot's file puts {both}; give one of them another topic there"
        found[key] = what
    return "", ""
