"""rclpy within a test, on a wire of its own."""

from collections.abc import Iterator

import pytest

from holozen.ros.rclpy import context as contexts
from holozen.ros.rclpy.context import Context
from holozen.testing import Wire


@pytest.fixture
def context(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    """A context whose nodes meet on this test's wire."""
    monkeypatch.setattr(contexts, "connection", wire.connection)
    context = Context()
    context.init(args=[])
    yield context
    context.try_shutdown()
