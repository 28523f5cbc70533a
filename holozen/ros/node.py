"""Node: what of a script stands on the wire. Each is a session of its own, and in the graph like any other."""

from collections.abc import Iterator, Sequence
from typing import Any, Self

from holozen.ros import arguments, parameters
from holozen.ros import context as contexts
from holozen.ros.callback_groups import CallbackGroup
from holozen.ros.client import Client
from holozen.ros.clock import Clock
from holozen.ros.context import Context
from holozen.ros.executor import Executor
from holozen.ros.guard_condition import GuardCondition
from holozen.ros.logging import RcutilsLogger
from holozen.ros.missing import Told
from holozen.ros.node_core import Core
from holozen.ros.node_graph import NodeGraph
from holozen.ros.node_makers import NodeMakers
from holozen.ros.parameters import NodeParameters
from holozen.ros.publisher import Publisher
from holozen.ros.service import Service
from holozen.ros.subscription import Subscription
from holozen.ros.time_source import TimeSource
from holozen.ros.timer import Timer

__all__ = ["HIDDEN_NODE_PREFIX", "Node"]

HIDDEN_NODE_PREFIX = "_"


class Node(NodeParameters, NodeGraph, NodeMakers, Told):
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
        context = context or contexts.get_default_context()
        words = context.arguments if use_global_arguments else arguments.Arguments()
        words = words.merged(arguments.parse(cli_args)) if cli_args is not None else words
        self._holozen = core = Core(node_name, namespace or "/", context, words)
        parameters.begin(
            self, parameter_overrides, allow_undeclared_parameters, automatically_declare_parameters_from_overrides,
            start_parameter_services,
        )  # fmt: skip
        core.time_source = TimeSource(self)
        core.time_source.attach_clock(core.clock)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.destroy_node()

    def __repr__(self) -> str:
        return f"<node {self._holozen.fqn}>"

    def get_name(self) -> str:
        """Its name, without the namespace."""
        return self._holozen.name

    def get_namespace(self) -> str:
        """Its namespace, with the first slash."""
        return self._holozen.namespace

    def get_fully_qualified_name(self) -> str:
        """Its absolute name."""
        return self._holozen.fqn

    def get_clock(self) -> Clock:
        """Its clock: ROS time, which is simulated where the parameter `use_sim_time` is true."""
        return self._holozen.clock

    def get_logger(self) -> RcutilsLogger:
        """Its logger."""
        return self._holozen.logger

    @property
    def context(self) -> Context:
        """The context it stands in."""
        return self._holozen.context

    @property
    def default_callback_group(self) -> CallbackGroup:
        """The group of all that is made without one."""
        return self._holozen.group

    @property
    def executor(self) -> Executor | None:
        """The executor that runs its callbacks."""
        return self._holozen.executor

    @executor.setter
    def executor(self, value: Executor | None) -> None:
        """Leave the one before."""
        before, self._holozen.executor = self._holozen.executor, value
        if before is not None and before is not value:
            before.remove_node(self)
        if value is not None:
            value.add_node(self)

    @property
    def publishers(self) -> Iterator[Publisher]:
        """Its publishers."""
        return iter(self._holozen.all(Publisher))

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Its subscriptions."""
        return iter(self._holozen.all(Subscription))

    @property
    def clients(self) -> Iterator[Client]:
        """Its clients."""
        return iter(self._holozen.all(Client))

    @property
    def services(self) -> Iterator[Service]:
        """Its services."""
        return iter(self._holozen.all(Service))

    @property
    def timers(self) -> Iterator[Timer]:
        """Its timers."""
        return iter(self._holozen.all(Timer))

    @property
    def guards(self) -> Iterator[GuardCondition]:
        """Its guard conditions."""
        return iter(self._holozen.all(GuardCondition))

    def destroy_node(self) -> None:
        """Leave: all that it has is destroyed. The others see so in a moment, at the latest when rclpy has ended."""
        core = self._holozen
        if core.executor is not None:
            core.executor.remove_node(self)
        core.leave()
