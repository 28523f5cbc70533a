"""TransformBroadcaster and StaticTransformBroadcaster: publish transforms on `tf` and
`tf_static`.
"""

from typing import Any

from holozen.ros.generated import find
from holozen.ros.rclpy.qos import DurabilityPolicy, QoSProfile

DEPTH = 100


class TransformBroadcaster:
    """Publishes transforms on `tf`."""

    def __init__(self, node: Any, qos: Any = None) -> None:
        self.pub_tf = node.create_publisher(
            find("tf2_msgs/msg/TFMessage"), "/tf", qos or QoSProfile(depth=DEPTH)
        )

    def sendTransform(self, transform: Any) -> None:
        """Publish a TransformStamped, or a list of them."""
        self.pub_tf.publish(self.pub_tf.msg_type(transforms=_as_list(transform)))


class StaticTransformBroadcaster:
    """Publishes transforms that never change on `tf_static`; late subscribers get all of them
    too.
    """

    def __init__(self, node: Any, qos: Any = None) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.pub_tf = node.create_publisher(
            find("tf2_msgs/msg/TFMessage"), "/tf_static", qos or latched
        )
        self._sent: dict[str, Any] = {}

    def sendTransform(self, transform: Any) -> None:
        """Publish a TransformStamped, or a list of them, together with all earlier ones."""
        self._sent |= {each.child_frame_id: each for each in _as_list(transform)}
        self.pub_tf.publish(self.pub_tf.msg_type(transforms=list(self._sent.values())))


def _as_list(transform: Any) -> list[Any]:
    return [transform] if hasattr(transform, "child_frame_id") else list(transform)
