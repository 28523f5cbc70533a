"""rclpy within a test, on a wire of its own."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from holozen.ros import context, rclpy
from holozen.ros.node import Node
from holozen.testing import Wire

PATIENCE = 10.0  # s


@pytest.fixture
def ros(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> Iterator[Wire]:
    """rclpy has begun, and its nodes meet on this test's wire."""
    monkeypatch.setattr(context, "connection", wire.connection)
    rclpy.init(args=[])
    yield wire
    rclpy.try_shutdown()


@pytest.fixture
def spin_for() -> Callable[..., Any]:
    """`spin_for(lambda: got, node)`: spin until a condition holds, and return what it gave."""

    def spin(condition: Callable[[], Any], *nodes: Node) -> Any:
        executor = rclpy.get_global_executor()
        for node in nodes:
            executor.add_node(node)

        deadline = time.monotonic() + PATIENCE
        while not (value := condition()):
            assert time.monotonic() < deadline, f"waited in vain; the last look gave {value!r}"
            executor.spin_once(timeout_sec=0.005)
        return value

    return spin
