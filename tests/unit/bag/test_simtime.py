"""The time of the simulation between the ticks of its clock."""

from holozen.bag.simtime import LONGEST, SimTime

MS = 1_000_000


def test_nobody_knows_the_time_before_the_first_tick() -> None:
    assert SimTime().of(5) is None


def test_between_two_ticks_it_goes_on_but_not_for_long_and_never_back() -> None:
    time = SimTime()
    time.tick(0, 1000 * MS)
    assert [time.of(1000 * MS), time.of(1015 * MS)] == [0, 15 * MS]
    time.tick(10 * MS, 1020 * MS)
    assert time.of(1021 * MS) == 15 * MS
    assert time.of(1030 * MS) == 20 * MS
    assert time.of(9000 * MS) == 10 * MS + LONGEST


def test_a_reset_takes_it_back() -> None:
    time = SimTime()
    time.tick(5000 * MS, 0)
    assert time.of(0) == 5000 * MS
    time.tick(0, 20 * MS)
    assert time.of(25 * MS) == 5 * MS
