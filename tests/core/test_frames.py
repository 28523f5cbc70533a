"""How long a robot's frames count without news of them."""

import pytest

from holozen.frames import Elapsed


@pytest.mark.parametrize(
    ("stamps", "total"),
    [
        ([0.0, 1.0, 2.0, 3.0], 3.0),
        ([7.0, 7.0, 7.0, 7.0], 0.0),  # paused
        ([0.0, 0.1, 0.2, 0.3], 0.3),  # slow
        ([0.0, 50.0, 51.0, 52.0], 3.0),  # a bag that leaps
        ([50.0, 51.0, 0.0, 1.0], 2.0),  # reset
    ],
)
def test_time_passes_when_it_does_for_the_clock_and_for_the_robot(
    stamps: list[float], total: float
) -> None:
    elapsed = Elapsed()
    for now, stamp in enumerate(stamps, 100):
        elapsed.update(now, stamp)
    assert elapsed.total == pytest.approx(total)
