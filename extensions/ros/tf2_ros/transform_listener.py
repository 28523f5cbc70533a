"""TransformListener: fills a Buffer from `tf` and `tf_static`."""

import contextlib
import threading
from typing import Any

from holozen.ros.generated import find
from holozen.ros.rclpy.callback_groups import ReentrantCallbackGroup
from holozen.ros.rclpy.context import ExternalShutdownException
from holozen.ros.rclpy.executors import SingleThreadedExecutor
from holozen.ros.rclpy.qos import DurabilityPolicy, QoSProfile
from holozen.ros.tf2_ros.buffer import Buffer
from holozen.ros.tf2_ros.buffer_core import InvalidArgumentException

DEPTH = 100
WARNING_PERIOD = 5.0  # s between two warnings


class TransformListener:
    """Fills a Buffer from `tf` and `tf_static` while its node is spun.

    With `spin_thread` it spins the node in a separate thread. `static_only` leaves out `tf`.
    """

    def __init__(
        self,
        buffer: Buffer,
        node: Any,
        *,
        spin_thread: bool = False,
        qos: Any = None,
        static_qos: Any = None,
        tf_topic: str = "/tf",
        tf_static_topic: str = "/tf_static",
        static_only: bool = False,
    ) -> None:
        self.buffer, self.node = buffer, node
        self.group = ReentrantCallbackGroup()
        kind, subscribe = find("tf2_msgs/msg/TFMessage"), node.create_subscription
        qos = qos or QoSProfile(depth=DEPTH)
        static_qos = static_qos or QoSProfile(
            depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        self._subscriptions = [
            subscribe(
                kind, tf_static_topic, self.static_callback, static_qos, callback_group=self.group
            )
        ]
        if not static_only:
            self._subscriptions.append(
                subscribe(kind, tf_topic, self.callback, qos, callback_group=self.group)
            )
        self.executor: Any = None
        if spin_thread:
            self.executor = SingleThreadedExecutor(context=node.context)
            self.executor.add_node(node)
            self.dedicated_listener_thread = threading.Thread(target=self._spin, daemon=True)
            self.dedicated_listener_thread.start()

    def callback(self, data: Any) -> None:
        """Add the transforms of a message on `tf`."""
        self._add(data, self.buffer.set_transform)

    def static_callback(self, data: Any) -> None:
        """Add the transforms of a message on `tf_static`."""
        self._add(data, self.buffer.set_transform_static)

    def unregister(self) -> None:
        """Stop listening."""
        if self.executor is not None:
            self.executor.shutdown()
            self.executor = None
        while self._subscriptions:
            self.node.destroy_subscription(self._subscriptions.pop())

    def _add(self, data: Any, set_transform: Any) -> None:
        for transform in data.transforms:
            try:
                set_transform(transform, "default_authority")
            except InvalidArgumentException as error:
                self.node.get_logger().warning(
                    f"ignored a transform: {error}", throttle_duration_sec=WARNING_PERIOD
                )

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self.executor.spin()
