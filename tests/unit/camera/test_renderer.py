"""The looks of entities that come and go, in the real renderer."""

import os
from pathlib import Path

from holozen.robot.description import read, written
from holozen.robot.loading import load
from services.camera.renderer import MAX_REMOVED, Renderer

REPO = Path(__file__).parents[3]


def test_the_looks_of_robots_that_left_take_a_bounded_memory() -> None:
    looks, renderer = read(written(load(REPO / "urdf" / "hb_bot.urdf.xacro", {}))), Renderer()

    def come_and_go(times: int) -> int:
        for number in range(times):
            renderer.add("Fred", number, looks)
            assert renderer.knows("Fred", number)
            renderer.remove("Fred")
            renderer.renew()
        return resident()

    before = come_and_go(MAX_REMOVED)
    assert come_and_go(MAX_REMOVED) - before < 40e6  # each takes 0.8 MB until the renderer is renewed
    renderer.close()


def resident() -> int:
    """Bytes of memory that this process has now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
