"""What a node makes and destroys: publishers, subscriptions, clients, services, timers, rates, guard conditions."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from holozen.messages import Message
from holozen.ros import names
from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.client import Client
from holozen.ros.clock import Clock
from holozen.ros.guard_condition import GuardCondition
from holozen.ros.publisher import Publisher
from holozen.ros.qos import QoSProfile, checked, qos_profile_services_default
from holozen.ros.service import Service
from holozen.ros.subscription import Subscription
from holozen.ros.timer import Rate, Timer

if TYPE_CHECKING:
    from holozen.ros.node import Node
    from holozen.ros.node_core import Core


class NodeMakers:
    """The `create_*` and `destroy_*` of a Node. All raise InvalidHandle where it was destroyed."""

    _holozen: "Core"

    def create_publisher(
        self,
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: Any = None,
        qos_overriding_options: Any = None,
        publisher_class: type[Publisher] = Publisher,
    ) -> Publisher:
        """A writer of messages on a topic."""
        self._holozen.check_open()
        _check_message(msg_type)
        full = self.resolve_topic_name(topic)
        return self._holozen.own(
            publisher_class(cast("Node", self), msg_type, full, names.key(full), checked(qos_profile))
        )

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[..., Any],
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: Any = None,
        qos_overriding_options: Any = None,
        raw: bool = False,
    ) -> Subscription:
        """Call `callback(message)` for each message on a topic, while the node is spun."""
        self._holozen.check_open()
        _check_message(msg_type)
        full, group = self.resolve_topic_name(topic), callback_group or self._holozen.group
        made = Subscription(
            cast("Node", self), msg_type, full, names.key(full), callback, group, checked(qos_profile), raw
        )
        return self._holozen.own(made)

    def create_client(
        self,
        srv_type: Any,
        srv_name: str,
        *,
        qos_profile: QoSProfile | int = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Client:
        """A caller of a service."""
        self._holozen.check_open()
        _check_service(srv_type)
        full, group = self.resolve_service_name(srv_name), callback_group or self._holozen.group
        made = Client(cast("Node", self), srv_type, full, names.key(full), group, checked(qos_profile))
        return self._holozen.own(made)

    def create_service(
        self,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: QoSProfile | int = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Service:
        """Answer requests with what `callback(request, response)` returns, while the node is spun."""
        self._holozen.check_open()
        _check_service(srv_type)
        full, group = self.resolve_service_name(srv_name), callback_group or self._holozen.group
        return self._holozen.own(
            Service(cast("Node", self), srv_type, full, names.key(full), callback, group, checked(qos_profile))
        )

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[..., Any] | None,
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Call `callback()` every so many seconds of a clock, by default the node's, while the node is spun."""
        period, group = int(float(timer_period_sec) * 1e9), callback_group or self._holozen.group
        return self._holozen.own(
            Timer(
                callback,
                group,
                period,
                clock or self._holozen.clock,
                context=self._holozen.context,
                autostart=autostart,
            )
        )

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """What sleeps so that a loop goes round `frequency` times a second, without spin."""
        if frequency <= 0:
            raise ValueError(f"frequency must be > 0, and {frequency} is not")
        return self._holozen.own(Rate(int(1e9 / frequency), clock or self._holozen.clock, self._holozen.context))

    def create_guard_condition(
        self, callback: Callable[[], Any], callback_group: CallbackGroup | None = None
    ) -> GuardCondition:
        """What lets any thread run `callback()` while the node is spun."""
        return self._holozen.own(GuardCondition(callback, callback_group or self._holozen.group))

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Write no more; whether it was this node's."""
        return self._holozen.disown(publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Listen no more; whether it was this node's."""
        return self._holozen.disown(subscription)

    def destroy_client(self, client: Client) -> bool:
        """Ask no more; whether it was this node's."""
        return self._holozen.disown(client)

    def destroy_service(self, service: Service) -> bool:
        """Answer no more; whether it was this node's."""
        return self._holozen.disown(service)

    def destroy_timer(self, timer: Timer) -> bool:
        """Call no more; whether it was this node's."""
        return self._holozen.disown(timer)

    def destroy_rate(self, rate: Rate) -> bool:
        """Sleep no more; whether it was this node's."""
        return self._holozen.disown(rate)

    def destroy_guard_condition(self, guard: GuardCondition) -> bool:
        """Call no more; whether it was this node's."""
        return self._holozen.disown(guard)

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """The absolute name of a topic of this node, remapped unless `only_expand`."""
        return self._holozen.resolve(topic, "topic", only_expand)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """The absolute name of a service of this node, remapped unless `only_expand`."""
        return self._holozen.resolve(service, "service", only_expand)


def _check_message(kind: Any) -> None:
    if not (isinstance(kind, type) and issubclass(kind, Message)):
        raise AttributeError(f"{kind!r} is no message type; import one: from geometry_msgs.msg import Twist")


def _check_service(kind: Any) -> None:
    halves = (getattr(kind, "Request", None), getattr(kind, "Response", None))
    if not all(isinstance(half, type) and issubclass(half, Message) for half in halves):
        raise AttributeError(f"{kind!r} is no service type; import one: from std_srvs.srv import Trigger")
