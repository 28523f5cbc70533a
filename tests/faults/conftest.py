"""Links and hosts with faults, for one test."""

from collections.abc import Iterator

import pytest

from holozen.testing import Wire

from .namespaces import Lab
from .proxy import Proxy


@pytest.fixture
def proxy(wire: Wire) -> Iterator[Proxy]:
    """A link to the port of this test's wire."""
    with Proxy(wire.port) as proxy:
        yield proxy


@pytest.fixture
def lab() -> Iterator[Lab]:
    """Hosts and cables of this test."""
    with Lab() as lab:
        yield lab
