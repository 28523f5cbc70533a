"""The image, built once; containers of it, started once a file."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest

from holozen.bus import Bus
from holozen.testing import wait_for

from .stack import ROOT, Stack, Watcher, docker, run

BASE = ROOT.parent / "shared" / "base-image"  # makes the base image where no registry can be reached
IN_CI = os.environ.get("CI") == "true"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """In CI, what BASE needs is installed as all else that tests need is: one after the other."""
    for item in items:
        if IN_CI and os.access(BASE, os.X_OK) and item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.needs("debootstrap"))


@pytest.fixture(scope="session")
def engine() -> None:
    """A Docker engine that answers, with the base image where we have to make it."""
    if not _answers() and IN_CI:
        subprocess.run(["service", "docker", "start"], stdin=subprocess.DEVNULL, capture_output=True)
        wait_for(_answers, within=30, what="the Docker engine")
    if not _answers():
        pytest.skip("needs a running Docker engine that this user may use: `docker info` fails")
    if os.access(BASE, os.X_OK):
        run(str(BASE))


@pytest.fixture(scope="package")
def image(engine: None) -> Iterator[str]:
    """The name of an image built from this tree by docker-compose; it is removed afterwards."""
    name = f"holozen-test:{uuid4().hex[:8]}"
    stack = Stack(name)
    stack.compose("build")
    yield name
    docker("rmi", name)


@pytest.fixture(scope="module")
def stack(image: str) -> Iterator[Stack]:
    """Healthy containers of all services but the teleop, for the tests of a file."""
    with Stack(image) as stack:
        yield stack


@pytest.fixture
def watcher(stack: Stack) -> Iterator[Watcher]:
    with Bus("test", stack.connection, patience=10) as bus:
        yield Watcher(bus)


def _answers() -> bool:
    return subprocess.run(["docker", "info"], capture_output=True).returncode == 0
