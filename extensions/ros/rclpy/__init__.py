"""rclpy: initialize, spin, shut down."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Self

from holozen.ros.rclpy import logging
from holozen.ros.rclpy.arguments import remove_ros_args
from holozen.ros.rclpy.context import (
    Context,
    SignalHandlerOptions,
    get_default_context,
    install_signal_handlers,
    uninstall_signal_handlers,
)
from holozen.ros.rclpy.executors import Executor, SingleThreadedExecutor
from holozen.ros.rclpy.node import Node
from holozen.ros.rclpy.parameter import Parameter
from holozen.ros.rclpy.task import Future

__all__ = [
    "Context",
    "Executor",
    "Future",
    "InitContextManager",
    "Node",
    "Parameter",
    "SignalHandlerOptions",
    "create_node",
    "get_default_context",
    "get_global_executor",
    "get_rmw_implementation_identifier",
    "init",
    "logging",
    "ok",
    "remove_ros_args",
    "shutdown",
    "spin",
    "spin_once",
    "spin_until_future_complete",
    "timeout_sec_to_nsec",
    "try_shutdown",
]

_executor: Executor | None = None


class InitContextManager:
    """Returned by `init`: `with rclpy.init():` shuts down at the end of the block."""

    def __init__(self, context: Context) -> None:
        self.context = context

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        try_shutdown(context=self.context)


def init(
    *,
    args: Sequence[str] | None = None,
    context: Context | None = None,
    domain_id: int | None = None,
    signal_handler_options: SignalHandlerOptions | None = None,
) -> InitContextManager:
    """Initialize rclpy. `args` is the command line with its --ros-args, by default the process's
    own.

    SIGINT and SIGTERM end the default context unless `signal_handler_options` changes that. Raises
    RuntimeError if it was initialized before.
    """
    if signal_handler_options is None:
        default = context is None or context is get_default_context()
        signal_handler_options = SignalHandlerOptions.ALL if default else SignalHandlerOptions.NO
    install_signal_handlers(signal_handler_options)
    context = context or get_default_context()
    context.init(args, domain_id=domain_id)
    return InitContextManager(context)


def ok(*, context: Context | None = None) -> bool:
    """Whether rclpy was initialized, and neither a signal nor `shutdown` has ended it."""
    return (context or get_default_context()).ok()


def shutdown(*, context: Context | None = None, uninstall_handlers: bool | None = None) -> None:
    """Shut down: all nodes leave. Raises RuntimeError if it was not initialized; after a signal it
    is allowed.
    """
    _end_global_state(context, uninstall_handlers)
    (context or get_default_context(shutting_down=True)).shutdown()


def try_shutdown(*, context: Context | None = None, uninstall_handlers: bool | None = None) -> None:
    """Shut down, unless that has been done."""
    _end_global_state(context, uninstall_handlers)
    if context is None or context is get_default_context():
        context = get_default_context(shutting_down=True)
    context.try_shutdown()


def create_node(node_name: str, **options: Any) -> Node:
    """A plain Node; the options are those of Node."""
    return Node(node_name, **options)


def get_global_executor() -> Executor:
    """The executor that `spin` uses if none is given."""
    global _executor
    if _executor is None or not (
        _executor.context.ok() or _executor.context is get_default_context()
    ):
        _executor = SingleThreadedExecutor()
    return _executor


def spin(node: Node, executor: Executor | None = None) -> None:
    """Run a node's callbacks until rclpy is shut down.

    Raises what a callback raises, and ExternalShutdownException when a signal shuts down rclpy
    while it spins.
    """
    with _spinning(node, executor) as running:
        running.spin()


def spin_once(
    node: Node, *, executor: Executor | None = None, timeout_sec: float | None = None
) -> None:
    """Run one callback. Waits for it at most `timeout_sec` seconds (None: for ever, 0: not at
    all).
    """
    with _spinning(node, executor) as running:
        running.spin_once(timeout_sec)


def spin_until_future_complete(
    node: Node, future: Future, executor: Executor | None = None, timeout_sec: float | None = None
) -> None:
    """Run a node's callbacks until a future is done, at most `timeout_sec` seconds."""
    with _spinning(node, executor) as running:
        running.spin_until_future_complete(future, timeout_sec)


@contextmanager
def _spinning(node: Node, executor: Executor | None) -> Iterator[Executor]:
    """The executor, which has the node for as long as it spins."""
    executor = executor or get_global_executor()
    added = executor.add_node(node)
    try:
        yield executor
    finally:
        if added:
            executor.remove_node(node)


def get_rmw_implementation_identifier() -> str:
    """The middleware."""
    return "zenoh"


def timeout_sec_to_nsec(timeout_sec: float | None) -> int:
    """Seconds as nanoseconds; -1 for None or a negative number, which mean for ever."""
    return -1 if timeout_sec is None or timeout_sec < 0 else int(float(timeout_sec) * 1e9)


def _end_global_state(context: Context | None, uninstall_handlers: bool | None) -> None:
    """The global executor and the signal handlers end before the default context."""
    global _executor
    is_default = context is None or context is get_default_context()
    if is_default and _executor is not None:
        _executor.shutdown()
        _executor = None
    if uninstall_handlers or (uninstall_handlers is None and is_default):
        uninstall_signal_handlers()
