"""A sim as fast as it goes, against another that keeps time."""

import pytest

from holozen.testing import Wire

from .conftest import start_sim
from .robots import Robot, time_of

pytestmark = pytest.mark.alone


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
