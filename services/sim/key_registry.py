"""Which keys the robots of a sim have, so that no two get each other's commands."""

from collections.abc import Collection

from holozen.command.stop_services import RobotServices
from holozen.messages.simulation_interfaces import SpawnEntityReply as Spawn
from holozen.robot.keys import shared
from holozen.robot.model import MOVING, RobotModel
from holozen.wire import SERVICES, robot_name

from .errors import EntityError
from .identity import Identity
from .other_nodes import OtherNodes

MAX_REASON = 300  # characters
TELEMETRY = {"clock", "simulation_status"}  # of the sim itself
OF_SIM = {row.key for row in SERVICES if row.server == "sim"} - {*RobotServices.VERBS} | TELEMETRY


class KeyRegistry:
    """The keys of the robots of this sim. It knows those of `others` by their tokens."""

    def __init__(self, others: OtherNodes) -> None:
        self._others = others
        self._owners: dict[str, str] = {}  # key -> robot's name

    def add(self, identity: Identity) -> None:
        """Take the keys of a robot, which were checked."""
        self._owners |= dict.fromkeys((key for key, _ in identity.keys), identity.name)

    def remove(self, name: str) -> None:
        """Free the keys of a robot."""
        self._owners = {key: owner for key, owner in self._owners.items() if owner != name}

    def check(self, identity: Identity, names: Collection[str]) -> None:
        """Raise EntityError if the keys of a robot are taken. `names` are those of the entities
        that there are.
        """
        if has_keys(identity.model):
            self._check_file(identity)
            self._check_robots(identity, names)
        if identity.odometry_key:
            self._check_others(identity, identity.odometry_key, names)

    def _check_file(self, identity: Identity) -> None:
        keys = dict(identity.keys)
        _, problem = shared(identity.model, identity.prefix)
        of_sim = OF_SIM & keys.keys()
        if of_sim:
            key = min(of_sim)
            both = f"{keys[key]} on the sim's own key {key!r}"
            problem = f"the robot's file puts {both}; give it another topic there"
        if problem:
            raise EntityError(Spawn.NAMESPACE_INVALID, problem)

    def _check_robots(self, identity: Identity, names: Collection[str]) -> None:
        name = identity.name
        taken = {key for key, _ in identity.keys if self._owners.get(key, name) != name}
        if not taken:
            return
        key = min(taken)
        if identity.prefix == name:
            advice = "use another name"
        else:
            advice = f"delete that one, or use {'another' if identity.prefix else 'a'} namespace"
        problem = f"{key} is the key of {self._owners[key]!r}; {advice}"
        raise EntityError(_conflict(identity, names), problem)

    def _check_others(self, identity: Identity, key: str, names: Collection[str]) -> None:
        if not self._others.publish(key):
            return
        for other in self._others.on(key, "pub"):
            problem = f"{key} is published by {other.node} ({other.session[:6]}) already"
            advice = "end that one, or use another name: --robot FILE=NAME"
            raise EntityError(_conflict(identity, names), f"{problem}; {advice}")


def check_names(identity: Identity) -> None:
    """Raise EntityError if the name or the prefix is not valid."""
    given = ((identity.name, Spawn.NAME_INVALID), (identity.prefix, Spawn.NAMESPACE_INVALID))
    for text, code in given:
        try:
            robot_name(text or "root")
        except ValueError as error:
            raise EntityError(code, str(error)[:MAX_REASON]) from None


def has_keys(model: RobotModel) -> bool:
    """Whether a model has keys: it has a drive, sensors, or moving joints."""
    moves = any(joint.kind in MOVING for joint in model.joints.values())
    return bool(model.drive or model.sensors) or moves


def _conflict(identity: Identity, names: Collection[str]) -> int:
    """The code where another robot has a key. It is not that of a name that is taken where an
    entity of that name would be replaced, since that one stays.
    """
    return Spawn.NAMESPACE_INVALID if identity.name in names else Spawn.NAME_NOT_UNIQUE
