"""Node: a script's presence in the graph, with its publishers, subscriptions, services, timers and
parameters.
"""

import sys
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

from holozen.messages import Message
from holozen.ros.catalog import HelpfulAttributes
from holozen.ros.generated import find
from holozen.ros.rclpy import arguments, names
from holozen.ros.rclpy.arguments import Arguments
from holozen.ros.rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from holozen.ros.rclpy.client import Client
from holozen.ros.rclpy.clock import USE_SIM_TIME, Clock, ROSClock, TimeSource
from holozen.ros.rclpy.context import Context, get_default_context
from holozen.ros.rclpy.exceptions import ParameterUninitializedException
from holozen.ros.rclpy.executors import Executor
from holozen.ros.rclpy.handle import NamesAndTypes, NodeHandle, names_and_types
from holozen.ros.rclpy.logging import RcutilsLogger
from holozen.ros.rclpy.parameter import (
    PARAMETER_SEPARATOR_STRING,
    Callback,
    Parameter,
    ParameterServices,
    ParameterStore,
    empty_descriptor,
    set_result,
)
from holozen.ros.rclpy.publisher import Publisher
from holozen.ros.rclpy.qos import (
    QoSProfile,
    as_profile,
    qos_profile_default,
    qos_profile_services_default,
)
from holozen.ros.rclpy.service import Service
from holozen.ros.rclpy.subscription import Subscription
from holozen.ros.rclpy.timer import Rate, Timer
from holozen.ros.rclpy.topic_check import TopicCheck, is_of_robot
from holozen.ros.rclpy.waitable import GuardCondition, Waitable, check_callback
from holozen.suggest import article
from holozen.transport import session
from holozen.transport.graph import Endpoint
from holozen.transport.parameters import is_below

__all__ = ["HIDDEN_NODE_PREFIX", "Node", "TopicEndpointInfo", "TopicEndpointTypeEnum"]

HIDDEN_NODE_PREFIX = "_"

T = TypeVar("T")

CLOSE_LIMIT = 0.15  # s for the threads of service calls to end
POLL = 0.01  # s between two checks for another node

_OURS = str(Path(__file__).parent)


class TopicEndpointTypeEnum(IntEnum):
    """The kind of an endpoint."""

    INVALID = 0
    PUBLISHER = 1
    SUBSCRIPTION = 2


class TopicEndpointInfo(NamedTuple):
    """A publisher or a subscription of any node. Its `qos_profile` is the default: the graph does
    not carry it.
    """

    node_name: str
    node_namespace: str
    topic_type: str
    endpoint_gid: str
    endpoint_type: TopicEndpointTypeEnum = TopicEndpointTypeEnum.INVALID
    qos_profile: QoSProfile = qos_profile_default


_ENDPOINT_TYPES = {
    "pub": TopicEndpointTypeEnum.PUBLISHER,
    "sub": TopicEndpointTypeEnum.SUBSCRIPTION,
}


class _State(NodeHandle):
    """The state of a Node, in its one attribute `_holozen`: all other names belong to the
    script.
    """

    store: ParameterStore
    time_source: TimeSource

    def __init__(
        self, node_name: str, namespace: str, context: Context, arguments: Arguments
    ) -> None:
        super().__init__(node_name, namespace, context, arguments)
        self.clock = ROSClock()
        self.executor: Executor | None = None
        self.owned: list[Any] = []  # publishers, subscriptions, timers ... in order of creation
        self.group: CallbackGroup = MutuallyExclusiveCallbackGroup()
        self._closing = threading.Lock()
        self._has_left = False
        self._calls: list[threading.Thread] = []
        self._topic_check: TopicCheck | None = None
        self._has_reported = False
        context.opened(self)

    def all(self, kind: type[T]) -> list[T]:
        """All that the node owns of a kind."""
        return [one for one in list(self.owned) if isinstance(one, kind)]

    def entities(self) -> list[Waitable]:
        """What an executor looks at, in this order."""
        tasks = [client.tasks for client in self.all(Client)]
        return [
            *self.all(Timer),
            *self.all(Subscription),
            *self.all(GuardCondition),
            *self.all(Service),
            *tasks,
        ]

    def own(self, made: T) -> T:
        """Keep something until it, or the node, is destroyed."""
        self.owned.append(made)
        if (
            self._topic_check is None
            and isinstance(made, Publisher | Subscription)
            and is_of_robot(made.topic)
        ):
            self._topic_check = TopicCheck(self)
        if self.executor is not None:
            self.executor.changed()
        return made

    def report_unused(self) -> None:
        """Warn, once, of parameters from outside that no node of this process declares."""
        if self._has_reported or not self.arguments.sections or self.store.allow_undeclared:
            return
        self._has_reported = True
        nodes = [
            one
            for one in self.context.all_open()
            if isinstance(one, _State) and hasattr(one, "store")
        ]
        declared = {name for node in nodes for name in node.store.values}
        for line in self.arguments.unused({node.full_name for node in nodes}, declared):
            self.logger.warning(line)

    def disown(self, made: Any) -> bool:
        """Destroy something. Returns whether it belonged to this node."""
        if made not in self.owned:
            return False
        self.owned = [one for one in self.owned if one is not made]
        if self.executor is not None:
            self.executor.changed()
        made.destroy()
        return True

    def leave(self) -> None:
        """Close in a thread, which the context waits for at its end.

        Thus many nodes of one process close at the same time: each has to announce to all others
        that it leaves.
        """
        self._detach()
        threading.Thread(target=self.close, daemon=True).start()

    def close(self) -> None:
        """Close the session, within half a second whatever the peers do; a second caller waits for
        the first.
        """
        self._detach()
        with self._closing:
            if not self._has_left:
                self.bus.close()
                session.wait_for_threads(self._calls, CLOSE_LIMIT)
                self._has_left = True
        self.context.closed(self)

    def _detach(self) -> None:
        self.is_closed = True
        owned, self.owned = self.owned, []
        self._calls += [
            thread for one in owned if isinstance(one, Client) for thread in one.threads()
        ]
        if self._topic_check is not None:
            self._topic_check.cancel()
            self._calls.append(self._topic_check.thread)
        for one in owned:
            one.detach()


def _owned(kind: type, doc: str) -> property:
    """An iterator over all that a node owns of a kind."""
    return property(lambda node: iter(node._holozen.all(kind)), doc=doc)


class Node(HelpfulAttributes):
    """A node of ROS, with its own session, and visible in the graph like any other.

    Raises NotInitializedException before `rclpy.init()`. Parameters that were not declared raise
    ParameterNotDeclaredException unless they are allowed; `create_*` raise InvalidHandle after
    `destroy_node()`.
    """

    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        cli_args: Sequence[str] | None = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
        parameter_overrides: list[Any] | None = None,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        enable_logger_service: bool = False,
    ) -> None:
        context = context or get_default_context()
        given = context.arguments if use_global_arguments else Arguments()
        given = given.merged(arguments.parse(cli_args)) if cli_args is not None else given
        self._holozen = state = _State(node_name, namespace or "/", context, given)
        values = given.parameters_for(state.full_name)
        overrides = {name: Parameter(name, value=value) for name, value in values.items()}
        overrides |= {each.name: each for each in _parameters(parameter_overrides or ())}
        state.store = ParameterStore(overrides, allow_undeclared_parameters)
        if automatically_declare_parameters_from_overrides:
            entries = [(name, each.value) for name, each in overrides.items()]
            self.declare_parameters("", entries, ignore_override=True)
        if USE_SIM_TIME not in state.store.values:
            self.declare_parameter(USE_SIM_TIME, False)
        if start_parameter_services:
            ParameterServices(self, state.full_name, state.store)
        state.time_source = TimeSource(self)
        state.time_source.attach_clock(state.clock)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.destroy_node()

    def __repr__(self) -> str:
        return f"<node {self._holozen.full_name}>"

    def get_name(self) -> str:
        """Its name, without the namespace."""
        return self._holozen.name

    def get_namespace(self) -> str:
        """Its namespace, with the leading slash."""
        return self._holozen.namespace

    def get_fully_qualified_name(self) -> str:
        """Its absolute name."""
        return self._holozen.full_name

    def get_clock(self) -> Clock:
        """Its clock: ROS time, which is simulated while the parameter `use_sim_time` is true."""
        return self._holozen.clock

    def get_logger(self) -> RcutilsLogger:
        """Its logger."""
        return self._holozen.logger

    @property
    def context(self) -> Context:
        """The context it was created in."""
        return self._holozen.context

    @property
    def default_callback_group(self) -> CallbackGroup:
        """The group of everything that is created without one."""
        return self._holozen.group

    @property
    def executor(self) -> Executor | None:
        """The executor that runs its callbacks."""
        return self._holozen.executor

    @executor.setter
    def executor(self, value: Executor | None) -> None:
        """Move to another executor."""
        before, self._holozen.executor = self._holozen.executor, value
        if before is not None and before is not value:
            before.remove_node(self)
        if value is not None:
            value.add_node(self)
            self._holozen.report_unused()

    publishers = _owned(Publisher, "Its publishers.")
    subscriptions = _owned(Subscription, "Its subscriptions.")
    clients = _owned(Client, "Its clients.")
    services = _owned(Service, "Its services.")
    timers = _owned(Timer, "Its timers.")
    guards = _owned(GuardCondition, "Its guard conditions.")

    def destroy_node(self) -> None:
        """Destroy the node and all it owns. The other nodes see it leave shortly, at the latest at
        shutdown.
        """
        state = self._holozen
        if state.executor is not None:
            state.executor.remove_node(self)
        state.leave()

    # Publishers, subscriptions, services, clients, timers

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
        """A publisher of messages on a topic."""
        self._holozen.check_open()
        _check_message(msg_type)
        full = self.resolve_topic_name(topic)
        return self._holozen.own(
            publisher_class(self._holozen, msg_type, full, as_profile(qos_profile))
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
            self._holozen, msg_type, full, callback, group, as_profile(qos_profile), raw
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
        """A client of a service."""
        self._holozen.check_open()
        _check_service(srv_type)
        full, group = self.resolve_service_name(srv_name), callback_group or self._holozen.group
        return self._holozen.own(
            Client(self._holozen, srv_type, full, group, as_profile(qos_profile))
        )

    def create_service(
        self,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: QoSProfile | int = qos_profile_services_default,
        callback_group: CallbackGroup | None = None,
    ) -> Service:
        """Answer requests with what `callback(request, response)` returns, while the node is
        spun.
        """
        self._holozen.check_open()
        _check_service(srv_type)
        full, group = self.resolve_service_name(srv_name), callback_group or self._holozen.group
        return self._holozen.own(
            Service(self._holozen, srv_type, full, callback, group, as_profile(qos_profile))
        )

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[..., Any] | None,
        callback_group: CallbackGroup | None = None,
        clock: Clock | None = None,
        autostart: bool = True,
    ) -> Timer:
        """Call `callback()` every `timer_period_sec` seconds of a clock, by default the node's,
        while it is spun.
        """
        check_callback(callback)
        state, period = self._holozen, int(float(timer_period_sec) * 1e9)
        group, clock = callback_group or state.group, clock or state.clock
        return state.own(
            Timer(callback, group, period, clock, context=state.context, autostart=autostart)
        )

    def create_rate(self, frequency: float, clock: Clock | None = None) -> Rate:
        """A Rate, whose `sleep()` keeps a loop at `frequency` (Hz). It does not need the node to be
        spun.
        """
        if frequency <= 0:
            raise ValueError(f"frequency must be > 0, and {frequency} is not")
        return self._holozen.own(
            Rate(int(1e9 / frequency), clock or self._holozen.clock, self._holozen.context)
        )

    def create_guard_condition(
        self, callback: Callable[[], Any], callback_group: CallbackGroup | None = None
    ) -> GuardCondition:
        """A guard condition: any thread can trigger it, and `callback()` runs while the node is
        spun.
        """
        return self._holozen.own(GuardCondition(callback, callback_group or self._holozen.group))

    def destroy_publisher(self, publisher: Publisher) -> bool:
        """Destroy a publisher. Returns whether it was this node's."""
        return self._holozen.disown(publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """Destroy a subscription. Returns whether it was this node's."""
        return self._holozen.disown(subscription)

    def destroy_client(self, client: Client) -> bool:
        """Destroy a client. Returns whether it was this node's."""
        return self._holozen.disown(client)

    def destroy_service(self, service: Service) -> bool:
        """Destroy a service. Returns whether it was this node's."""
        return self._holozen.disown(service)

    def destroy_timer(self, timer: Timer) -> bool:
        """Destroy a timer. Returns whether it was this node's."""
        return self._holozen.disown(timer)

    def destroy_rate(self, rate: Rate) -> bool:
        """Destroy a rate. Returns whether it was this node's."""
        return self._holozen.disown(rate)

    def destroy_guard_condition(self, guard: GuardCondition) -> bool:
        """Destroy a guard condition. Returns whether it was this node's."""
        return self._holozen.disown(guard)

    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str:
        """The absolute name of a topic of this node, remapped unless `only_expand`."""
        return self._holozen.resolve(topic, "topic", only_expand)

    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str:
        """The absolute name of a service of this node, remapped unless `only_expand`."""
        return self._holozen.resolve(service, "service", only_expand)

    # Parameters

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Declare a parameter with its default, or its Parameter.Type. A value from the command
        line or a file wins.

        Raises ParameterAlreadyDeclaredException, InvalidParameterException for an empty name,
        InvalidParameterTypeException for an override of another type than the default's,
        InvalidParameterValueException for one outside the descriptor's range or rejected by a
        callback.
        """
        entry = (name,) if value is None and descriptor is None else (name, value, descriptor)
        return self.declare_parameters("", [entry], ignore_override)[0]

    def declare_parameters(
        self, namespace: str, parameters: Sequence[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Declare several parameters, each (name), (name, value) or (name, value, descriptor).
        Raises as `declare_parameter`.
        """
        entries = [_declaration(each, namespace) for each in parameters]
        with self._holozen.store.lock:
            self._holozen.store.check_new([name for name, _, _ in entries])
            return [self._holozen.store.declare(*entry, ignore_override) for entry in entries]

    def undeclare_parameter(self, name: str) -> None:
        """Remove a parameter. Raises ParameterNotDeclaredException, ParameterImmutableException."""
        with self._holozen.store.lock:
            self._holozen.store.check_changeable(name)
            self._holozen.store.forget(name)

    def has_parameter(self, name: str) -> bool:
        """Whether it is declared."""
        return name in self._holozen.store.values

    def get_parameter(self, name: str) -> Parameter:
        """A parameter. Raises ParameterUninitializedException if only its type was declared and no
        value was set.
        """
        # Without the lock: a callback that decides about a change may wait for a thread that reads
        # a parameter.
        self._holozen.store.check_known([name])
        found, descriptor = (
            self._holozen.store.values.get(name),
            self._holozen.store.descriptors.get(name),
        )
        if found and found.value is None and descriptor and not descriptor.dynamic_typing:
            raise ParameterUninitializedException(name)
        return found or Parameter(name)

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        """Several parameters, see `get_parameter`."""
        if isinstance(names, str) or not all(isinstance(name, str) for name in names):
            raise TypeError(f"names must be a list of str, not {names!r}")
        return [self.get_parameter(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """A parameter, or the alternative if it is not declared or has no value."""
        found = self._holozen.store.values.get(name)
        return found if found and found.value is not None else alternative_value or Parameter(name)

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """The parameters below `prefix`, by the rest of their names; all of them for an empty
        prefix.
        """
        start = prefix + PARAMETER_SEPARATOR_STRING if prefix else ""
        names = [name for name in list(self._holozen.store.values) if name.startswith(start)]
        return {name.removeprefix(start): self.get_parameter(name) for name in names}

    def get_parameter_type(self, name: str) -> Parameter.Type:
        """The type of a parameter."""
        return self.get_parameter_types([name])[0]

    def get_parameter_types(self, names: Sequence[str]) -> list[Parameter.Type]:
        """The types of several parameters."""
        self._holozen.store.check_known(names)
        return [(self._holozen.store.values.get(name) or Parameter(name)).type_ for name in names]

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[Any]:
        """Set each on its own: a SetParametersResult for each, with the reason of a rejection."""
        parameters = _parameters(parameter_list)
        self._holozen.store.check_known(each.name for each in parameters)
        return [set_result(self._holozen.store.set([each])) for each in parameters]

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        """Set all or none: one SetParametersResult."""
        return set_result(self._holozen.store.set(_parameters(parameter_list)))

    def list_parameters(self, prefixes: Sequence[str], depth: int) -> Any:
        """The ListParametersResult of the names below `prefixes` with at most `depth` parts after
        them (0: any).
        """
        found = [
            name
            for name in list(self._holozen.store.values)
            if is_below(name, list(prefixes), depth)
        ]
        places = sorted({name.rpartition(PARAMETER_SEPARATOR_STRING)[0] for name in found} - {""})
        return find("rcl_interfaces/msg/ListParametersResult")(names=found, prefixes=places)

    def describe_parameter(self, name: str) -> Any:
        """The ParameterDescriptor of a parameter."""
        return self.describe_parameters([name])[0]

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        """The ParameterDescriptor of each."""
        self._holozen.store.check_known(names)
        return [
            self._holozen.store.descriptors.get(name) or empty_descriptor(name) for name in names
        ]

    def set_descriptor(self, name: str, descriptor: Any, alternative_value: Any = None) -> Any:
        """Replace the descriptor of a parameter, and its value if `alternative_value` is given; its
        ParameterValue.

        Raises InvalidParameterValueException if the new descriptor does not allow the value, and
        ParameterImmutableException.
        """
        with self._holozen.store.lock:
            self._holozen.store.check_changeable(name)
            new = self.get_parameter(name)
            if alternative_value is not None:
                message = find("rcl_interfaces/msg/Parameter")(name=name, value=alternative_value)
                new = Parameter.from_parameter_msg(message)
            self._holozen.store.describe(name, descriptor, new)
        return new.get_parameter_value()

    def add_pre_set_parameters_callback(self, callback: Callback) -> None:
        """Call with a list of Parameter before they are set; what it returns is set instead."""
        self._holozen.store.pre.insert(0, callback)

    def add_on_set_parameters_callback(self, callback: Callback) -> None:
        """Call with a list of Parameter that are about to be set; it returns a
        SetParametersResult.
        """
        self._holozen.store.on.insert(0, callback)

    def add_post_set_parameters_callback(self, callback: Callback) -> None:
        """Call with a list of Parameter after they were set."""
        self._holozen.store.post.insert(0, callback)

    def remove_pre_set_parameters_callback(self, callback: Callback) -> None:
        """Raises ValueError if it was not added."""
        self._holozen.store.pre.remove(callback)

    def remove_on_set_parameters_callback(self, callback: Callback) -> None:
        """Raises ValueError if it was not added."""
        self._holozen.store.on.remove(callback)

    def remove_post_set_parameters_callback(self, callback: Callback) -> None:
        """Raises ValueError if it was not added."""
        self._holozen.store.post.remove(callback)

    # The graph, which lists the nodes of holozen and of `holozen run`, but no other Zenoh program

    def count_publishers(self, topic_name: str) -> int:
        """How many publishers a topic has."""
        return len(self._holozen.endpoints_on(topic_name, "pub"))

    def count_subscribers(self, topic_name: str) -> int:
        """How many subscriptions a topic has."""
        return len(self._holozen.endpoints_on(topic_name, "sub"))

    def count_services(self, service_name: str) -> int:
        """How many nodes provide a service."""
        return len(self._holozen.endpoints_on(service_name, "srv"))

    def get_topic_names_and_types(self, no_demangle: bool = False) -> NamesAndTypes:
        """Every topic with its types."""
        return names_and_types(
            end for end in self._holozen.endpoints() if end.kind in ("pub", "sub")
        )

    def get_service_names_and_types(self) -> NamesAndTypes:
        """Every service with its types."""
        return names_and_types(end for end in self._holozen.endpoints() if end.kind == "srv")

    def get_publishers_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """The publishers of a topic."""
        return [_endpoint_info(end) for end in self._holozen.endpoints_on(topic_name, "pub")]

    def get_subscriptions_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]:
        """The subscriptions of a topic."""
        return [_endpoint_info(end) for end in self._holozen.endpoints_on(topic_name, "sub")]

    def get_publisher_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """The topics that a node publishes."""
        return names_and_types(self._holozen.endpoints_of(node_name, node_namespace, "pub"))

    def get_subscriber_names_and_types_by_node(
        self, node_name: str, node_namespace: str, no_demangle: bool = False
    ) -> NamesAndTypes:
        """The topics that a node subscribes to."""
        return names_and_types(self._holozen.endpoints_of(node_name, node_namespace, "sub"))

    def get_service_names_and_types_by_node(
        self, node_name: str, node_namespace: str
    ) -> NamesAndTypes:
        """The services that a node provides."""
        return names_and_types(self._holozen.endpoints_of(node_name, node_namespace, "srv"))

    def get_node_names(self) -> list[str]:
        """The name of every node, without its namespace."""
        return [name for name, _ in self.get_node_names_and_namespaces()]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        """(name, namespace) of every node."""
        return [
            _name_and_namespace(end.node) for end in self._holozen.endpoints() if end.kind == "node"
        ]

    def get_fully_qualified_node_names(self) -> list[str]:
        """The absolute name of every node."""
        return [f"/{end.node}" for end in self._holozen.endpoints() if end.kind == "node"]

    def wait_for_node(self, fully_qualified_node_name: str, timeout: float) -> bool:
        """Wait at most `timeout` seconds for a node. Returns whether it is there.

        Raises as `Client.wait_for_service`.
        """
        deadline = time.monotonic() + timeout
        wanted = names.expand(
            fully_qualified_node_name, self._holozen.name, self._holozen.namespace
        )
        while wanted not in self.get_fully_qualified_node_names():
            self._holozen.context.check_running(f"wait for {wanted}")
            if time.monotonic() > deadline:
                return False
            time.sleep(POLL)
        return True


def _check_message(kind: Any) -> None:
    if not (isinstance(kind, type) and issubclass(kind, Message)):
        import_one = "import one: from geometry_msgs.msg import Twist"
        hint = (
            f"write {type(kind).__name__}, without ()" if isinstance(kind, Message) else import_one
        )
        raise AttributeError(f"{kind!r:.80} is not a message type; {hint}")


def _check_service(kind: Any) -> None:
    halves = (getattr(kind, "Request", None), getattr(kind, "Response", None))
    if not all(isinstance(half, type) and issubclass(half, Message) for half in halves):
        raise AttributeError(
            f"{kind!r} is not a service type; import one: from std_srvs.srv import Trigger"
        )


def _parameters(given: Sequence[Parameter]) -> list[Parameter]:
    found = list(given)
    for each in found:
        if not isinstance(each, Parameter):
            raise TypeError(
                f"use a list of rclpy.parameter.Parameter; {each!r} is "
                f"{article(type(each).__name__)}"
            )
    return found


def _declaration(entry: tuple[Any, ...], namespace: str) -> tuple[str, Any, Any]:
    """(name, value, descriptor) of an entry of `declare_parameters`."""
    if not isinstance(entry, tuple | list) or not 1 <= len(entry) <= 3:
        raise TypeError(
            f"{entry!r} does not declare a parameter; write (name, value), or (name, value, "
            "descriptor)"
        )
    name, *rest = entry
    names.text_of(name, "the name of a parameter")
    full = f"{namespace}{PARAMETER_SEPARATOR_STRING}{name}" if namespace and name else name
    value, descriptor = [*rest, None, None][:2]
    if not rest:
        text = f"parameter {name!r} accepts any type: give it a default, or a Parameter.Type"
        warnings.warn(text, stacklevel=_stack_level_of_the_script())
        return full, None, empty_descriptor(full, dynamic_typing=True)
    if descriptor is None:
        descriptor = empty_descriptor(full)
    elif getattr(descriptor, "ROS", "") != "rcl_interfaces/msg/ParameterDescriptor":
        raise TypeError(
            f"parameter {name!r}: {descriptor!r} is not a ParameterDescriptor of rcl_interfaces.msg"
        )
    return full, value, descriptor


def _stack_level_of_the_script() -> int:
    """How many frames above its caller the script's own is, as `warnings.warn` counts them."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OURS):
        frame, level = frame.f_back, level + 1
    return level


def _endpoint_info(end: Endpoint) -> TopicEndpointInfo:
    return TopicEndpointInfo(
        *_name_and_namespace(end.node), end.type, end.session, _ENDPOINT_TYPES[end.kind]
    )


def _name_and_namespace(node: str) -> tuple[str, str]:
    """The name and the namespace of a node, from its name in the graph."""
    namespace, _, name = node.rpartition("/")
    return name, f"/{namespace}"
