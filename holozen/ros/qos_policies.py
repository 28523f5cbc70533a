"""The quality of service policies, each an enum with ROS's numbers."""

from enum import IntEnum
from typing import Self


class QoSPolicyEnum(IntEnum):
    """What all policies can: their members by ROS's short words, such as `keep_last`."""

    @classmethod
    def short_keys(cls) -> list[str]:
        """The short words."""
        return [name.lower() for name in cls.__members__ if not name.startswith("RMW")]

    @classmethod
    def get_from_short_key(cls, name: str) -> Self:
        """The member of a short word. Raises KeyError for one that there is not."""
        try:
            return cls[name.upper()]
        except KeyError:
            raise KeyError(f"no {cls.__name__} {name!r}; use one of {', '.join(cls.short_keys())}") from None

    @property
    def short_key(self) -> str:
        """Its short word."""
        return self.name.lower()


class HistoryPolicy(QoSPolicyEnum):
    """How many messages wait: the newest `depth`, or all."""

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
    """Whether who comes late gets the last messages."""

    SYSTEM_DEFAULT = RMW_QOS_POLICY_DURABILITY_SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL = 1
    VOLATILE = RMW_QOS_POLICY_DURABILITY_VOLATILE = 2
    UNKNOWN = RMW_QOS_POLICY_DURABILITY_UNKNOWN = 3
    BEST_AVAILABLE = 4


class LivelinessPolicy(QoSPolicyEnum):
    """Who says that a publisher is alive. Taken and kept; on Zenoh it is always the session's token."""

    SYSTEM_DEFAULT = RMW_QOS_POLICY_LIVELINESS_SYSTEM_DEFAULT = 0
    AUTOMATIC = RMW_QOS_POLICY_LIVELINESS_AUTOMATIC = 1
    MANUAL_BY_TOPIC = RMW_QOS_POLICY_LIVELINESS_MANUAL_BY_TOPIC = 3
    UNKNOWN = RMW_QOS_POLICY_LIVELINESS_UNKNOWN = 4
    BEST_AVAILABLE = 5
