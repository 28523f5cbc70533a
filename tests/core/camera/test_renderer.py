"""The looks of entities that come and go, in the real renderer."""

import os
from pathlib import Path
from typing import Any

from holozen.robot.files.description import read, written
from holozen.robot.files.loading import load

REPO = Path(__file__).parents[3]
FEW, MANY = 30, 70  # robots; pybullet frees the memory of 100 bodies, of four a robot, at once


def test_the_looks_of_robots_that_left_take_a_bounded_memory(renderer: Any) -> None:
    looks = read(written(load(REPO / "urdf" / "hb_bot.urdf.xacro", {})))

    def come_and_go(times: int) -> int:
        for number in range(times):
            renderer.add("Fred", number, looks)
            assert renderer.knows("Fred", number)
            renderer.remove("Fred")
            renderer.renew()
        return resident()

    before = come_and_go(FEW)
    assert come_and_go(MANY) - before < 40e6  # each takes 0.8 MB until the renderer is renewed


def resident() -> int:
    """Bytes of memory that this process has now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
