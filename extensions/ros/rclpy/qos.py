"""QoSProfile, its policies and presets, and whether two profiles are compatible.

Over Zenoh `depth` is the number of messages that wait for a callback, KEEP_ALL makes a publisher
wait where a link is full, and TRANSIENT_LOCAL gives late subscribers the last message. The other
policies are stored and have no effect.
"""

import warnings
from enum import Enum, IntEnum
from typing import Any, Self

from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.rclpy.time import Duration
from holozen.suggest import article

__all__ = [
    "DurabilityPolicy",
    "HistoryPolicy",
    "InvalidQoSProfileException",
    "LivelinessPolicy",
    "QoSCompatibility",
    "QoSDurabilityPolicy",
    "QoSHistoryPolicy",
    "QoSLivelinessPolicy",
    "QoSPolicyEnum",
    "QoSPresetProfiles",
    "QoSProfile",
    "QoSReliabilityPolicy",
    "ReliabilityPolicy",
    "qos_check_compatible",
    "qos_profile_action_status_default",
    "qos_profile_best_available",
    "qos_profile_default",
    "qos_profile_parameter_events",
    "qos_profile_parameters",
    "qos_profile_sensor_data",
    "qos_profile_services_default",
    "qos_profile_system_default",
    "qos_profile_unknown",
]


class QoSPolicyEnum(IntEnum):
    """The base of all policies: members can be looked up by ROS's short keys, such as
    `keep_last`.
    """

    @classmethod
    def short_keys(cls) -> list[str]:
        """The short keys."""
        return [name.lower() for name in cls.__members__ if not name.startswith("RMW")]

    @classmethod
    def get_from_short_key(cls, name: str) -> Self:
        """The member with a short key. Raises KeyError for an unknown one."""
        try:
            return cls[name.upper()]
        except KeyError:
            raise KeyError(
                f"no {cls.__name__} {name!r}; use one of {', '.join(cls.short_keys())}"
            ) from None

    @property
    def short_key(self) -> str:
        """Its short key."""
        return self.name.lower()


class HistoryPolicy(QoSPolicyEnum):
    """Which messages are kept: the newest `depth`, or all."""

    SYSTEM_DEFAULT = RMW_QOS_POLICY_HISTORY_SYSTEM_DEFAULT = 0
    KEEP_LAST = RMW_QOS_POLICY_HISTORY_KEEP_LAST = 1
    KEEP_ALL = RMW_QOS_POLICY_HISTORY_KEEP_ALL = 2
    UNKNOWN = RMW_QOS_POLICY_HISTORY_UNKNOWN = 3


class ReliabilityPolicy(QoSPolicyEnum):
    """Whether a message may be lost."""

    SYSTEM_DEFAULT = RMW_QOS_POLICY_RELIABILITY_SYSTEM_DEFAULT = 0
    RELIABLE = RMW_QOS_POLICY_RELIABILITY_RELIABLE = 1
    BEST_EFFORT = RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT = 2
    UNKNOWN = RMW_QOS_POLICY_RELIABILITY_UNKNOWN = 3
    BEST_AVAILABLE = 4


class DurabilityPolicy(QoSPolicyEnum):
    """Whether late subscribers get the last messages."""

    SYSTEM_DEFAULT = RMW_QOS_POLICY_DURABILITY_SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL = 1
    VOLATILE = RMW_QOS_POLICY_DURABILITY_VOLATILE = 2
    UNKNOWN = RMW_QOS_POLICY_DURABILITY_UNKNOWN = 3
    BEST_AVAILABLE = 4


class LivelinessPolicy(QoSPolicyEnum):
    """How a publisher shows that it is alive. Stored without effect: over Zenoh it is always the
    session's token.
    """

    SYSTEM_DEFAULT = RMW_QOS_POLICY_LIVELINESS_SYSTEM_DEFAULT = 0
    AUTOMATIC = RMW_QOS_POLICY_LIVELINESS_AUTOMATIC = 1
    MANUAL_BY_TOPIC = RMW_QOS_POLICY_LIVELINESS_MANUAL_BY_TOPIC = 3
    UNKNOWN = RMW_QOS_POLICY_LIVELINESS_UNKNOWN = 4
    BEST_AVAILABLE = 5


QoSHistoryPolicy, QoSReliabilityPolicy = HistoryPolicy, ReliabilityPolicy
QoSDurabilityPolicy, QoSLivelinessPolicy = DurabilityPolicy, LivelinessPolicy

# messages that wait under KEEP_ALL: a script that never spins must not fill the memory
UNBOUNDED = 10_000
DEFAULT_DEPTH = 10  # messages that wait if a profile gives no depth

DEFAULTS = {
    "history": HistoryPolicy.KEEP_LAST,
    "depth": 0,
    "reliability": ReliabilityPolicy.RELIABLE,
    "durability": DurabilityPolicy.VOLATILE,
    "lifespan": Duration(),
    "deadline": Duration(),
    "liveliness": LivelinessPolicy.SYSTEM_DEFAULT,
    "liveliness_lease_duration": Duration(),
    "avoid_ros_namespace_conventions": False,
}
"""The fields of a profile, and their defaults."""

KINDS = {name: type(default) for name, default in DEFAULTS.items()}


class InvalidQoSProfileException(Exception):
    """A profile without the required fields."""

    def __init__(self, *args: object) -> None:
        super().__init__("; ".join(["invalid QoSProfile", *map(str, args)]))


class QoSProfile(HelpfulAttributes):
    """How messages of a topic are queued and sent. All arguments by keyword; `history` or `depth`
    is required.

    Raises InvalidQoSProfileException without them, AssertionError for an unknown argument or one of
    a wrong type.
    """

    __slots__ = tuple(KINDS)
    __hash__ = None  # type: ignore[assignment]  # a profile is mutable

    history: HistoryPolicy
    depth: int
    reliability: ReliabilityPolicy
    durability: DurabilityPolicy
    lifespan: Duration
    deadline: Duration
    liveliness: LivelinessPolicy
    liveliness_lease_duration: Duration
    avoid_ros_namespace_conventions: bool

    def __init__(self, **kwargs: Any) -> None:
        unknown = ", ".join(sorted(set(kwargs) - set(KINDS)))
        assert not unknown, f"QoSProfile has no {unknown}; use {', '.join(KINDS)}"
        if not kwargs.keys() & {"history", "depth"}:
            raise InvalidQoSProfileException("give its depth, or its history")
        values = DEFAULTS | kwargs
        if values["history"] == HistoryPolicy.KEEP_LAST and "depth" not in kwargs:
            raise InvalidQoSProfileException("its history is KEEP_LAST, so give its depth")
        for name, value in values.items():
            setattr(self, name, value)
        if self.history == HistoryPolicy.KEEP_LAST and self.depth == 0:
            text = (
                f"KEEP_LAST with a depth of 0 would keep nothing; {DEFAULT_DEPTH} messages are kept"
            )
            warnings.warn(text, stacklevel=2)

    def __setattr__(self, name: str, value: Any) -> None:
        kind = KINDS.get(name)
        if kind is None:
            raise AttributeError(f"QoSProfile has no {name}; it has {', '.join(KINDS)}")
        if issubclass(kind, IntEnum) and type(value) is int:
            value = kind(value)
        is_one = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        assert is_one, (
            f"QoSProfile.{name}: {value!r} is {article(type(value).__name__)}; use "
            f"{article(kind.__name__)}"
        )
        if name == "depth" and value < 0:
            raise ValueError(f"QoSProfile.depth: {value}; use 0 or more messages")
        object.__setattr__(self, name, value)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, QoSProfile):
            return False
        return all(getattr(self, name) == getattr(other, name) for name in KINDS)

    def __repr__(self) -> str:
        values = []
        for name in KINDS:
            value = getattr(self, name)
            shown = (
                f"{type(value).__name__}.{value.name}"
                if isinstance(value, IntEnum)
                else repr(value)
            )
            values.append(f"{name}={shown}")
        return f"QoSProfile({', '.join(values)})"


qos_profile_default = QoSProfile(depth=10)
qos_profile_unknown = QoSProfile(
    history=HistoryPolicy.UNKNOWN,
    reliability=ReliabilityPolicy.UNKNOWN,
    durability=DurabilityPolicy.UNKNOWN,
    liveliness=LivelinessPolicy.UNKNOWN,
)
qos_profile_system_default = QoSProfile(
    history=HistoryPolicy.SYSTEM_DEFAULT,
    reliability=ReliabilityPolicy.SYSTEM_DEFAULT,
    durability=DurabilityPolicy.SYSTEM_DEFAULT,
)
qos_profile_sensor_data = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = QoSProfile(depth=10)
qos_profile_parameters = QoSProfile(depth=1000)
qos_profile_parameter_events = QoSProfile(depth=1000)
qos_profile_action_status_default = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
qos_profile_best_available = QoSProfile(
    depth=10,
    reliability=ReliabilityPolicy.BEST_AVAILABLE,
    durability=DurabilityPolicy.BEST_AVAILABLE,
    liveliness=LivelinessPolicy.BEST_AVAILABLE,
)


class QoSPresetProfiles(Enum):
    """The presets by name; `.value` is the profile."""

    UNKNOWN = qos_profile_unknown
    DEFAULT = qos_profile_default
    SYSTEM_DEFAULT = qos_profile_system_default
    SENSOR_DATA = qos_profile_sensor_data
    SERVICES_DEFAULT = qos_profile_services_default
    PARAMETERS = qos_profile_parameters
    PARAMETER_EVENTS = qos_profile_parameter_events
    ACTION_STATUS_DEFAULT = qos_profile_action_status_default
    BEST_AVAILABLE = qos_profile_best_available

    @classmethod
    def short_keys(cls) -> list[str]:
        """The names in lower case."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> QoSProfile:
        """The profile of a name. Raises KeyError for an unknown one."""
        try:
            return cls[name.upper()].value
        except KeyError:
            raise KeyError(
                f"no preset {name!r}; use one of {', '.join(cls.short_keys())}"
            ) from None


class QoSCompatibility(IntEnum):
    """Whether a publisher and a subscription with two profiles would be connected."""

    OK = 0
    WARNING = 1
    ERROR = 2


def qos_check_compatible(
    publisher_qos: QoSProfile, subscription_qos: QoSProfile
) -> tuple[QoSCompatibility, str]:
    """Whether ROS would connect the two, and the reason if not. Over Zenoh all are connected."""
    offered, wanted = publisher_qos, subscription_qos
    reasons = []
    if (
        wanted.reliability == ReliabilityPolicy.RELIABLE
        and offered.reliability == ReliabilityPolicy.BEST_EFFORT
    ):
        reasons.append("ERROR: a best effort publisher and a reliable subscription")
    if (
        wanted.durability == DurabilityPolicy.TRANSIENT_LOCAL
        and offered.durability == DurabilityPolicy.VOLATILE
    ):
        reasons.append("ERROR: a volatile publisher and a transient local subscription")
    if reasons:
        return QoSCompatibility.ERROR, "; ".join(reasons)
    unset = [
        f"WARNING: {name} is not set on both sides"
        for name in ("reliability", "durability")
        if any(
            getattr(side, name).name in ("SYSTEM_DEFAULT", "UNKNOWN") for side in (offered, wanted)
        )
    ]
    return (QoSCompatibility.WARNING if unset else QoSCompatibility.OK), "; ".join(unset)


def as_profile(qos: QoSProfile | int) -> QoSProfile:
    """The argument of a `create_*` method as a profile. Raises TypeError, or ValueError for a
    negative depth.
    """
    if isinstance(qos, QoSProfile):
        return qos
    if isinstance(qos, bool) or not isinstance(qos, int):
        given = article(type(qos).__name__)
        raise TypeError(
            f"{qos!r} is {given}; use a QoSProfile, or the depth of the queue as an int"
        )
    if qos < 0:
        raise ValueError(f"the depth of a queue must be 0 or more, not {qos}")
    return qos_profile_default if qos == 0 else QoSProfile(depth=qos)


def queue_length(qos: QoSProfile) -> int:
    """How many messages at most wait for the callback."""
    return UNBOUNDED if qos.history == HistoryPolicy.KEEP_ALL else qos.depth or DEFAULT_DEPTH
