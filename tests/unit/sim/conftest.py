"""Worlds with the real engine, and robots of a few lines of URDF."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from holozen.robot.model import WorldSpec
from services.sim.physics.world import World


@pytest.fixture
def space() -> Iterator[World]:
    """Nothing, and no gravity."""
    with closing(World(WorldSpec(gravity=(0, 0, 0), ground=False))) as world:
        yield world


@pytest.fixture
def air() -> Iterator[World]:
    """Gravity, and no ground."""
    with closing(World(WorldSpec(ground=False))) as world:
        yield world


@pytest.fixture
def ground() -> Iterator[World]:
    """Gravity and a flat ground."""
    with closing(World(WorldSpec(ground=True))) as world:
        yield world
