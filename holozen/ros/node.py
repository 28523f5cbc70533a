"""Node: what of a script stands on the wire. Each is a session of its own, and in the graph like any other."""

import threading
from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

from holozen import threads
from holozen.bus import Bus
from holozen.ros import arguments, names
from holozen.ros import context as contexts
from holozen.ros.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from holozen.ros.client import Client
from holozen.ros.clock import Clock, ROSClock
from holozen.ros.context import Context
from holozen.ros.exceptions import InvalidHandle, NotInitializedException
from holozen.ros.executor import Entity, Executor
from holozen.ros.guard_condition import GuardCondition
from holozen.ros.logging import RcutilsLogger, get_logger
from holozen.ros.node_graph import NodeGraph
from holozen.ros.node_makers import NodeMakers
from holozen.ros.parameters import NodeParameters
from holozen.ros.publisher import Publisher
from holozen.ros.service import Service
from holozen.ros.subscription import Subscription
from holozen.ros.time_source import TimeSource
from holozen.ros.timer import Timer

__all__ = ["Node"]

T = TypeVar("T")

CLOSE_LIMIT = 0.15  # s for the threads of calls to end


class Node(NodeParameters, NodeGraph, NodeMakers):
    """A node of ROS. Raises NotInitializedException before `rclpy.init()`."""

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
        self.context = context or contexts.get_default_context()
        if not self.context.ok():
            raise NotInitializedException(f"cannot create node {node_name!r}")
        words = self.context.arguments if use_global_arguments else arguments.Arguments()
        self._arguments = words.merged(arguments.parse(cli_args)) if cli_args is not None else words
        self._name = self._arguments.node_name(names.check_node_name(node_name))
        self._namespace = self._arguments.namespace(names.check_namespace(namespace or "/"), node_name)
        self._fqn = names.join(self._namespace, self._name)
        self._logger = get_logger(names.key(self._fqn).replace("/", "."))
        self._clock = ROSClock()
        self._executor: Executor | None = None
        self._owned: list[Any] = []  # publishers, subscriptions, timers ... in the order they were made
        self._closing, self._closed = threading.Lock(), False
        self.default_callback_group: CallbackGroup = MutuallyExclusiveCallbackGroup()
        self.bus = Bus(names.key(self._fqn), contexts.connection, lasting=True)
        self.context.opened(self)
        self._init_graph()
        self._init_parameters(
            self._arguments, parameter_overrides, allow_undeclared_parameters,
            automatically_declare_parameters_from_overrides, start_parameter_services,
        )  # fmt: skip
        self._time_source = TimeSource(self)
        self._time_source.attach_clock(self._clock)

    def __repr__(self) -> str:
        return f"<node {self._fqn}>"

    def get_name(self) -> str:
        """Its name, without the namespace."""
        return self._name

    def get_namespace(self) -> str:
        """Its namespace, with the first slash."""
        return self._namespace

    def get_fully_qualified_name(self) -> str:
        """Its absolute name."""
        return self._fqn

    def get_clock(self) -> Clock:
        """Its clock: ROS time, which is simulated where the parameter `use_sim_time` is true."""
        return self._clock

    def get_logger(self) -> RcutilsLogger:
        """Its logger."""
        return self._logger

    @property
    def executor(self) -> Executor | None:
        """The executor that runs its callbacks."""
        return self._executor

    @executor.setter
    def executor(self, value: Executor | None) -> None:
        """Leave the one before."""
        before, self._executor = self._executor, value
        if before is not None and before is not value:
            before.remove_node(self)
        if value is not None:
            value.add_node(self)

    @property
    def publishers(self) -> Iterator[Publisher]:
        """Its publishers."""
        return (one for one in list(self._owned) if isinstance(one, Publisher))

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Its subscriptions."""
        return (one for one in list(self._owned) if isinstance(one, Subscription))

    @property
    def clients(self) -> Iterator[Client]:
        """Its clients."""
        return (one for one in list(self._owned) if isinstance(one, Client))

    @property
    def services(self) -> Iterator[Service]:
        """Its services."""
        return (one for one in list(self._owned) if isinstance(one, Service))

    @property
    def timers(self) -> Iterator[Timer]:
        """Its timers."""
        return (one for one in list(self._owned) if isinstance(one, Timer))

    @property
    def guards(self) -> Iterator[GuardCondition]:
        """Its guard conditions."""
        return (one for one in list(self._owned) if isinstance(one, GuardCondition))

    def entities(self) -> list[Entity]:
        """What an executor looks at, in that order."""
        tasks = [client.tasks for client in self.clients]
        return [*self.timers, *self.subscriptions, *self.guards, *self.services, *tasks]

    def destroy_node(self) -> None:
        """Leave: all that it has is destroyed."""
        if self._executor is not None:
            self._executor.remove_node(self)
        self.context.closed(self)
        self.close()

    def close(self) -> None:
        """Leave the wire. Returns within half a second, whatever the others do."""
        with self._closing:
            if self._closed:
                return
            self._closed = True
        owned, self._owned = self._owned, []
        calls = [thread for one in owned if isinstance(one, Client) for thread in one.threads()]
        for one in owned:
            one.silence()
        self.bus.close()
        threads.wait(calls, CLOSE_LIMIT)

    def _own(self, made: T) -> T:
        self._owned.append(made)
        if self._executor is not None:
            self._executor.changed()
        return made

    def _disown(self, made: Any) -> bool:
        if made not in self._owned:
            return False
        self._owned = [one for one in self._owned if one is not made]
        if self._executor is not None:
            self._executor.changed()
        made.destroy()
        return True

    def _check_open(self) -> None:
        if self._closed:
            raise InvalidHandle(f"node {self._fqn} was destroyed, or rclpy shut down")

    def _resolve(self, name: str, kind: str, only_expand: bool) -> str:
        full = names.expand(name, self._name, self._namespace, kind=kind)
        return full if only_expand else self._arguments.remap(full, self._name, self._namespace, kind=kind)
