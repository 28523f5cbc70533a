"""What a node is told of another one's publisher or subscription."""

from enum import IntEnum
from typing import NamedTuple

from holozen.ros.qos import QoSProfile, qos_profile_default

__all__ = ["TopicEndpointInfo", "TopicEndpointTypeEnum"]


class TopicEndpointTypeEnum(IntEnum):
    """Which of the two it is."""

    INVALID = 0
    PUBLISHER = 1
    SUBSCRIPTION = 2


class TopicEndpointInfo(NamedTuple):
    """A publisher or a subscription of some node. Its `qos_profile` is the default one: the graph tells none."""

    node_name: str
    node_namespace: str
    topic_type: str
    endpoint_gid: str
    endpoint_type: TopicEndpointTypeEnum = TopicEndpointTypeEnum.INVALID
    qos_profile: QoSProfile = qos_profile_default
