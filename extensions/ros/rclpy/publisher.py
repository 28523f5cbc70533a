"""Publisher: sends messages on a topic."""

from typing import Any

from holozen.command.feedback import CommandFeedback
from holozen.messages import CommandStatus
from holozen.messages.codec import decoder
from holozen.ros.rclpy.callback_groups import CallbackGroup
from holozen.ros.rclpy.exceptions import InvalidHandle
from holozen.ros.rclpy.handle import NodeHandle, Owned, wrong_type
from holozen.ros.rclpy.names import key
from holozen.ros.rclpy.qos import HistoryPolicy, QoSProfile
from holozen.transport.bus import LARGEST_STATE
from holozen.transport.graph import subscribers
from holozen.transport.pubsub import Latest, Subscription
from holozen.wire import FORCE, VELOCITIES, is_command, key_for

__all__ = ["Publisher"]


class Publisher(Owned):
    """Created by `Node.create_publisher`. Sends with Zenoh's priority DATA; late subscribers can
    get the last message.

    Messages are dropped where a link is full; with a history of KEEP_ALL the publisher waits
    instead. One of velocity commands logs a warning when the robot stops obeying them, with the
    reason, and when it obeys again. For forces, of which a robot has several, the first publisher
    of the node does.
    """

    def __init__(
        self, handle: NodeHandle, msg_type: Any, topic: str, qos_profile: QoSProfile
    ) -> None:
        self.msg_type, self.topic, self.qos_profile = msg_type, topic, qos_profile
        self._handle = handle
        block = qos_profile.history == HistoryPolicy.KEEP_ALL
        self._writer: Any = handle.bus.publisher(key(topic), msg_type, block=block)
        self.callback_group: CallbackGroup | None = None
        status = _status_key(key(topic), msg_type.ROS)
        self._watched = status if status not in handle.watched else ""
        self._feedback = self._listen() if self._watched else None

    @property
    def topic_name(self) -> str:
        """Its topic, absolute and remapped."""
        return self.topic

    def publish(self, msg: Any) -> None:
        """Send a message, or the bytes of one. Raises TypeError for another type.

        A message with a NaN or an infinity is sent as CDR whatever the wire format: the others
        cannot express them.
        """
        self._handle.context.check_can_publish()
        writer = self._writer
        if writer is None:
            raise InvalidHandle(f"the publisher of {self.topic} was destroyed")
        if not isinstance(msg, self.msg_type | bytes):
            raise wrong_type(self.topic, self.msg_type.__name__, msg)
        try:
            if isinstance(msg, bytes):
                if writer.echoes:
                    writer.echoes.settle()
                writer.put_bytes(msg)
            else:
                writer.put(msg)
        except Exception:
            if self._writer is None:  # another thread has destroyed it
                raise InvalidHandle(f"the publisher of {self.topic} was destroyed") from None
            raise
        if self._feedback:
            if isinstance(msg, bytes) or self.msg_type.ROS not in VELOCITIES:
                self._feedback.look()
            else:
                self._feedback.sent(msg)

    def get_subscription_count(self) -> int:
        """How many subscriptions receive what is sent now; 1 if only programs that are not holozen
        nodes do.
        """
        self._handle.context.check_can_publish(f"count the subscriptions of {self.topic}")
        if self._writer is None or not self._writer.matched:
            return 0  # a subscription may be in the graph before the route to it is established
        return subscribers(self._handle.endpoints(), key(self.topic), matched=True)

    def assert_liveliness(self) -> None:
        """Does nothing: Zenoh tracks liveliness."""

    def wait_for_all_acked(self, timeout: Any = None) -> bool:
        """Always true: Zenoh has accepted everything that `publish` was given."""
        return True

    def _listen(self) -> CommandFeedback:
        def report(text: str) -> None:
            self._handle.logger.warning(f"{self.topic}: {text}")

        bus, status = self._handle.bus, self._watched
        self._handle.watched.add(status)
        # Not announced: ROS's publishers read nothing.
        samples = bus.subscribe_raw(status, depth=1, limit=LARGEST_STATE)
        self._status = Latest(Subscription(samples, decoder((CommandStatus,), tolerant=True)))
        return CommandFeedback(
            bus.source, status, self._status, self.msg_type.ROS in VELOCITIES, report=report
        )

    def detach(self) -> None:
        """Stop sending; the bus is about to close."""
        self._writer = None

    def destroy(self) -> None:
        """Stop sending, and leave the topic."""
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()
            if self._feedback:
                self._status.close()
                self._handle.watched.discard(self._watched)


def _status_key(topic: str, type_name: str) -> str:
    """The key of the status of commands on a topic, or "" if they are no velocities or forces."""
    if type_name in VELOCITIES and is_command(topic, (type_name,)):
        return f"{topic}_status"
    return key_for("cmd_vel_status", topic.rpartition("/")[0]) if type_name == FORCE else ""
