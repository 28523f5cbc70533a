"""The image, built once; containers of it, started once a file."""

import os
import subprocess
from collections.abc import Iterator
from uuid import uuid4

import pytest

from holozen.bus import Bus

from .stack import ROOT, Stack, Watcher, docker, run

IN_CI = os.environ.get("CI") == "true"


@pytest.fixture(scope="session")
def engine() -> None:
    """A Docker engine that answers; in CI scripts/image starts it."""
    if not IN_CI and subprocess.run(["docker", "info"], capture_output=True).returncode != 0:
        pytest.skip("needs a running Docker engine that this user may use: `docker info` fails")


@pytest.fixture(scope="package")
def image(engine: None) -> Iterator[str]:
    """The name of an image built from this tree by docker-compose; it is removed afterwards."""
    name = f"holozen-test:{uuid4().hex[:8]}"
    run(str(ROOT / "scripts" / "image"), name)
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
