"""The pytest fixtures. pytest finds them by this package's entry point: a test needs no import."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from holozen.testing.lock_step import LockStep
from holozen.testing.process import wait_for as wait
from holozen.testing.terminal import Terminal
from holozen.testing.wire import Wire


@pytest.fixture
def wire() -> Iterator[Wire]:
    """A network of its own for a test. Everything started on it ends with the test.

    To share one among the tests of a file, write such a fixture with `scope="module"`.
    """
    with Wire() as wire:
        yield wire


@pytest.fixture
def terminal(wire: Wire) -> Callable[..., Terminal]:
    """`terminal("teleop", "--speed", "0.3")`: a holozen verb in a pseudo-terminal, on this test's wire."""
    return wire.terminal


@pytest.fixture
def lock_step(wire: Wire) -> Callable[..., LockStep]:
    """`lock_step("--robot", "my_bot.urdf.xacro")`: a paused sim on this test's wire, which the test steps: see
    LockStep.
    """
    return partial(LockStep, wire)


@pytest.fixture
def wait_for() -> Callable[..., Any]:
    """`wait_for(lambda: odom.count > 3, within=5)`: wait for a condition rather than for a time."""
    return wait
