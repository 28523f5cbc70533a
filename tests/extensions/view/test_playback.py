"""A bag in the page: it goes to any time, pauses, and ends, on a bus that nobody else reaches."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from holozen.bags import BagError
from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.testing import wait_for
from holozen.view.playback import ALONE, Playback
from tests.extensions.bags.bags import a_bag


class Shown:
    """A bag of 2 s, in which odometry says x = t at 10 Hz, and what a page receives of it."""

    def __init__(self, bus: Bus, path: Path) -> None:
        self._odom = bus.latest("odom", Odometry)
        self.playback = Playback(bus, str(a_bag(path)))

    def shows(self, x: float) -> bool:
        return self.x == x

    @property
    def x(self) -> float:
        """The newest x."""
        odom = self._odom.read()[0]
        return odom.pose.pose.position.x if odom else -1.0


@pytest.fixture
def bag(tmp_path: Path) -> Iterator[Shown]:
    with Bus("view", ALONE) as bus:
        shown = Shown(bus, tmp_path / "a.mcap")
        yield shown
        shown.playback.close()


def test_it_begins_paused_and_a_seek_shows_what_held_then(bag: Shown) -> None:
    assert bag.playback.paused
    assert bag.playback.duration == pytest.approx(2.0)
    for to, x in ((1.55, 1.5), (0.25, 0.2), (5.0, 1.9)):
        bag.playback.seek(to)
        wait_for(partial(bag.shows, x), what=f"odometry of {to} s")
        assert bag.playback.position == pytest.approx(to)
        assert bag.playback.paused


def test_it_plays_to_its_end_pauses_there_and_begins_again(bag: Shown) -> None:
    bag.playback.seek(1.5)
    wait_for(lambda: bag.x == 1.5, what="the seek")
    bag.playback.toggle()
    wait_for(lambda: bag.playback.paused, what="the end")
    assert bag.playback.position == pytest.approx(2.0)
    wait_for(partial(bag.shows, 1.9), what="the last odometry")
    bag.playback.toggle()
    wait_for(
        lambda: 0.0 < bag.playback.position < 1.9 and not bag.playback.paused,
        what="it to begin again",
    )


def test_a_pause_holds_it_where_it_is(bag: Shown) -> None:
    bag.playback.toggle()
    wait_for(lambda: bag.x > 0.25, what="it to play")
    bag.playback.toggle()
    bag.playback.seek(1.0)
    wait_for(lambda: bag.x == 1.0, what="the seek")
    assert bag.playback.paused


def test_a_file_that_is_no_bag_is_reported(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("no bag")
    with Bus("view", ALONE) as bus, pytest.raises(BagError, match=r"a\.mcap"):
        Playback(bus, str(tmp_path / "a.mcap"))
