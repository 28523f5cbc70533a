"""Sim time against real time. Sims that run side by side are each other's clock."""

import contextlib

import pytest

from holozen.testing import Wire, wait_for

from .conftest import start_sim
from .robots import Robot, time_of

pytestmark = pytest.mark.alone


def advances(*flags: tuple[str, ...], span: float) -> list[float]:
    """How far the time of sims with these flags goes while that of the first goes on by `span`
    seconds.
    """
    with contextlib.ExitStack() as ends:
        robots = []
        for words in flags:
            wire = ends.enter_context(Wire())
            start_sim(wire, *words)
            robots.append(Robot(wire.bus()))
        begin = [time_of(robot.newest()) for robot in robots]
        wait_for(lambda: time_of(robots[0].newest()) >= begin[0] + span, 60)
        return [time_of(robot.newest()) - start for robot, start in zip(robots, begin, strict=True)]


def test_a_factor_of_zero_is_as_fast_as_it_goes_and_still_hears_and_stops_by_real_time() -> None:
    with Wire() as slow, Wire() as wire:
        start_sim(slow)
        real = Robot(slow.bus())
        start_sim(wire, "--rtf", "0")
        fast = Robot(wire.bus())
        before, began = time_of(fast.newest()), time_of(real.newest())
        fast.drive(0.3)
        fast.stands()
        assert time_of(fast.newest()) - before > 2 * (time_of(real.newest()) - began)
