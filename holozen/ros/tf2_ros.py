"""tf2_ros on the keys `tf` and `tf_static`: who listens there, and who tells."""

import threading
from typing import Any

from holozen.ros import generated
from holozen.ros.callback_groups import ReentrantCallbackGroup
from holozen.ros.executors import ExternalShutdownException, SingleThreadedExecutor
from holozen.ros.qos import DurabilityPolicy, QoSProfile
from holozen.ros.tf2_buffer import Buffer, TransformRegistration, TypeException
from holozen.ros.tf2_frames import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)

__all__ = [
    "Buffer",
    "ConnectivityException",
    "ExtrapolationException",
    "InvalidArgumentException",
    "LookupException",
    "StaticTransformBroadcaster",
    "TimeoutException",
    "TransformBroadcaster",
    "TransformException",
    "TransformListener",
    "TransformRegistration",
    "TypeException",
]

DEPTH = 100
TELL = 5.0  # s between two warnings


class TransformListener:
    """Fills a Buffer with what comes on `tf` and `tf_static`, while its node is spun.

    With `spin_thread` it spins the node in a thread of its own. `static_only` leaves `tf` out.
    """

    def __init__(
        self, buffer: Buffer, node: Any, *, spin_thread: bool = False, qos: Any = None, static_qos: Any = None,
        tf_topic: str = "/tf", tf_static_topic: str = "/tf_static", static_only: bool = False,
    ) -> None:  # fmt: skip
        self.buffer, self.node = buffer, node
        self.group = ReentrantCallbackGroup()
        kind = generated.find("tf2_msgs/msg/TFMessage")
        qos = qos or QoSProfile(depth=DEPTH)
        static_qos = static_qos or QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        listen = node.create_subscription
        self._subscriptions = [
            listen(kind, tf_static_topic, self.static_callback, static_qos, callback_group=self.group)
        ]
        if not static_only:
            self._subscriptions.append(listen(kind, tf_topic, self.callback, qos, callback_group=self.group))
        self.executor: Any = None
        if spin_thread:
            self.executor = SingleThreadedExecutor(context=node.context)
            self.executor.add_node(node)
            self.dedicated_listener_thread = threading.Thread(target=self._spin, daemon=True)
            self.dedicated_listener_thread.start()

    def callback(self, data: Any) -> None:
        """What came on `tf`."""
        self._put(data, self.buffer.set_transform)

    def static_callback(self, data: Any) -> None:
        """What came on `tf_static`."""
        self._put(data, self.buffer.set_transform_static)

    def unregister(self) -> None:
        """Listen no more."""
        if self.executor is not None:
            self.executor.shutdown()
            self.executor = None
        while self._subscriptions:
            self.node.destroy_subscription(self._subscriptions.pop())

    def _put(self, data: Any, put: Any) -> None:
        for transform in data.transforms:
            try:
                put(transform, "default_authority")
            except InvalidArgumentException as error:
                self.node.get_logger().warning(f"tf: left out: {error}", throttle_duration_sec=TELL)

    def _spin(self) -> None:
        try:
            self.executor.spin()
        except ExternalShutdownException:
            pass


class TransformBroadcaster:
    """Tells transforms on `tf`."""

    def __init__(self, node: Any, qos: Any = None) -> None:
        self.pub_tf = node.create_publisher(_kind(), "/tf", qos or QoSProfile(depth=DEPTH))

    def sendTransform(self, transform: Any) -> None:
        """Tell a TransformStamped, or a list of them."""
        self.pub_tf.publish(_kind()(transforms=_listed(transform)))


class StaticTransformBroadcaster:
    """Tells transforms that never change on `tf_static`; who comes late gets them all too."""

    def __init__(self, node: Any, qos: Any = None) -> None:
        lasting = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.pub_tf = node.create_publisher(_kind(), "/tf_static", qos or lasting)
        self._told: dict[str, Any] = {}

    def sendTransform(self, transform: Any) -> None:
        """Tell a TransformStamped, or a list of them, and again those told before."""
        self._told |= {each.child_frame_id: each for each in _listed(transform)}
        self.pub_tf.publish(_kind()(transforms=list(self._told.values())))


def _kind() -> Any:
    return generated.find("tf2_msgs/msg/TFMessage")


def _listed(transform: Any) -> list[Any]:
    return [transform] if hasattr(transform, "child_frame_id") else list(transform)
