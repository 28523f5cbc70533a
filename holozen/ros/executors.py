"""The executors, by the name of ROS's module."""

from collections.abc import Callable
from typing import Any

from holozen.ros.context import ExternalShutdownException
from holozen.ros.entity import Entity
from holozen.ros.executor import (
    ConditionReachedException,
    Executor,
    ShutdownException,
    TimeoutException,
)
from holozen.ros.multi_threaded_executor import MultiThreadedExecutor

__all__ = [
    "ConditionReachedException", "Executor", "ExternalShutdownException", "MultiThreadedExecutor",
    "ShutdownException", "SingleThreadedExecutor", "TimeoutException",
]  # fmt: skip


class SingleThreadedExecutor(Executor):
    """Runs callbacks in the thread that spins, one after the other."""

    def _execute(self, entity: Entity, work: Callable[[], Any]) -> None:
        self._run(entity, work)
