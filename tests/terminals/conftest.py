"""A sim with a robot, and terminals to drive it from."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.integration.conftest import only_robot, robot, sim, start_sim, town

from .kitty import Display, Kitty

__all__ = ["only_robot", "robot", "sim", "start_sim", "town"]


@pytest.fixture(scope="module")
def display() -> Iterator[Display]:
    """An X server for the tests of a file."""
    with Display() as display:
        yield display


@pytest.fixture(scope="module")
def kitty(display: Display, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Kitty]:
    """A kitty for the tests of a file; it has the keyboard."""
    with Kitty(display, tmp_path_factory.mktemp("kitty")) as kitty:
        yield kitty


@pytest.fixture
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a short name, as sockets need it."""
    return tmp_path_factory.mktemp("k")
