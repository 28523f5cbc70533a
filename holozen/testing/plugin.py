"""The pytest fixtures. pytest finds them by this package's entry point: a test needs no import."""

from collections.abc import Callable, Generator, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from holozen.testing.lock_step import LockStep
from holozen.testing.process import wait_for as wait
from holozen.testing.terminal import Terminal
from holozen.testing.wire import Wire

ARTIFACTS = "--holozen-artifacts"
_failed = pytest.StashKey[bool]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --holozen-artifacts to pytest's flags."""
    parser.getgroup("holozen").addoption(
        ARTIFACTS,
        metavar="DIR",
        help="of each failed test with the fixture `wire`: leave a bag, a picture of the paths "
        "and the logs in DIR",
    )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, Any]:
    """Note whether any part of a test has failed, for its fixture `wire`."""
    report = yield
    item.stash[_failed] = item.stash.get(_failed, False) or report.failed
    return report


@pytest.fixture
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    """A network of its own for a test. Everything started on it ends with the test.

    To share one among the tests of a file, write such a fixture with `scope="module"`.
    """
    folder = request.config.getoption(ARTIFACTS)
    with Wire() as wire:
        if folder is None:
            yield wire
            return
        from holozen.testing.artifacts import Artifacts, folder_name

        artifacts = Artifacts(wire, Path(folder) / folder_name(request.node.nodeid))
        yield wire
        if request.node.stash.get(_failed, False):
            artifacts.keep()
        else:
            artifacts.discard()


@pytest.fixture
def terminal(wire: Wire) -> Callable[..., Terminal]:
    """`terminal("teleop", "--speed", "0.3")`: a holozen verb in a pseudo-terminal, on this test's
    wire.
    """
    return wire.terminal


@pytest.fixture
def lock_step(wire: Wire) -> Callable[..., LockStep]:
    """`lock_step("--robot", "my_bot.urdf.xacro")`: a paused sim on this test's wire, which the test
    steps: see LockStep.
    """
    return partial(LockStep, wire)


@pytest.fixture
def wait_for() -> Callable[..., Any]:
    """`wait_for(lambda: odom.count > 3, within=5)`: wait for a condition rather than for a time."""
    return wait
