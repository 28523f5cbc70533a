"""Publisher: writes messages on a topic."""

from typing import TYPE_CHECKING, Any

from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.exceptions import InvalidHandle
from holozen.ros.missing import Told
from holozen.ros.qos import HistoryPolicy, QoSProfile

if TYPE_CHECKING:
    from holozen.ros.node import Node

__all__ = ["Publisher"]


class Publisher(Told):
    """Made by `Node.create_publisher`. Sends with Zenoh's priority DATA, and gives the last message to who comes late.

    Where a link is full a message is dropped; with a history of KEEP_ALL the publisher waits.
    """

    def __init__(self, node: "Node", msg_type: Any, topic: str, key: str, qos_profile: QoSProfile) -> None:
        self.msg_type, self.topic, self.qos_profile = msg_type, topic, qos_profile
        self._node = node
        block = qos_profile.history == HistoryPolicy.KEEP_ALL
        self._writer: Any = node._holozen.bus.publisher(key, msg_type, block=block)
        self.callback_group: CallbackGroup | None = None

    @property
    def topic_name(self) -> str:
        """Its topic, absolute and remapped."""
        return self.topic

    @property
    def logger_name(self) -> str:
        """The name of its node's logger."""
        return str(self._node.get_logger().name)

    def publish(self, msg: Any) -> None:
        """Send a message, or the bytes of one. Raises TypeError for another type.

        One with a NaN or an infinity goes out as CDR, whatever the wire: no other one has them.
        """
        self._node.context.check_may_speak()
        writer = self._writer
        if writer is None:
            raise InvalidHandle(f"the publisher of {self.topic} was destroyed")
        if not isinstance(msg, self.msg_type | bytes):
            given = msg.__name__ if isinstance(msg, type) else type(msg).__name__
            hint = f"; write {given}()" if isinstance(msg, type) else ""
            raise TypeError(f"{self.topic}: expected a {self.msg_type.__name__}, and got a {given}{hint}")
        try:
            (writer.put_bytes if isinstance(msg, bytes) else writer.put)(msg)
        except Exception:
            if self._writer is None:  # destroyed by another thread meanwhile
                raise InvalidHandle(f"the publisher of {self.topic} was destroyed") from None
            raise

    def get_subscription_count(self) -> int:
        """How many subscriptions of our nodes read its topic, 1 if only strangers do: what is sent now reaches them."""
        self._node.context.check_may_speak(f"count who reads {self.topic}")
        if self._writer is None or not self._writer.matched:
            return 0  # a token may be here before the way to its subscription is
        return max(1, self._node.count_subscribers(self.topic))

    def assert_liveliness(self) -> None:
        """Nothing has to be done: Zenoh knows who is there."""

    def wait_for_all_acked(self, timeout: Any = None) -> bool:
        """Whether all was sent: Zenoh has taken in what `publish` was given."""
        return True

    def silence(self) -> None:
        """Write no more; the bus is about to close."""
        self._writer = None

    def destroy(self) -> None:
        """Write no more."""
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()
