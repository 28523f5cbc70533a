"""Each renderer: pybullet's where it is installed, and numpy's."""

from collections.abc import Iterator
from typing import Any

import pytest

from holozen import engines
from services.camera.rasterizer import Rasterizer


def renderers() -> dict[str, Any]:
    """The class of each renderer that runs here."""
    found: dict[str, Any] = {"numpy": Rasterizer}
    if engines.is_installed(engines.PYBULLET):
        from services.camera.renderer import Renderer

        found["pybullet"] = Renderer
    return found


@pytest.fixture(params=renderers())
def renderer(request: pytest.FixtureRequest) -> Iterator[Any]:
    """A renderer with an empty scene."""
    made = renderers()[request.param]()
    yield made
    made.close()
