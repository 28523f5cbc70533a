"""Worlds with a real engine: the default one, and each that is installed for tests that are marked
so.

@pytest.mark.engines def test_it_drives(ground: World):
"""

from collections.abc import Iterator
from contextlib import closing

import pytest

from holozen.engines import choose, is_installed
from holozen.flags import ENGINES
from holozen.robot.model import WorldSpec
from services.sim.physics.world import World


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if metafunc.definition.get_closest_marker("engines"):
        metafunc.parametrize("engine", [one for one in ENGINES if is_installed(one)], indirect=True)


@pytest.fixture
def engine(request: pytest.FixtureRequest) -> str:
    """The name of the engine that this test's worlds use."""
    return str(getattr(request, "param", "") or choose().engine)


@pytest.fixture
def space(engine: str) -> Iterator[World]:
    """A world with nothing in it, and no gravity."""
    with closing(World(WorldSpec(gravity=(0, 0, 0), ground=False), engine)) as world:
        yield world


@pytest.fixture
def air(engine: str) -> Iterator[World]:
    """A world with gravity and no ground."""
    with closing(World(WorldSpec(ground=False), engine)) as world:
        yield world


@pytest.fixture
def ground(engine: str) -> Iterator[World]:
    """A world with gravity and a flat ground."""
    with closing(World(WorldSpec(ground=True), engine)) as world:
        yield world
