"""Recent sources: bounded, and counted over the last second."""

from itertools import product

import pytest

from holozen.command.inputs import MAX_RATES, RECENT, SourceRates


@pytest.fixture
def rates() -> SourceRates:
    return SourceRates()


def reported(rates: SourceRates, now: float) -> dict[str, float]:
    return {source: rate for source, _, rate, _ in rates.recent(now)}


def test_the_rate_is_that_of_the_last_second_or_so_however_often_one_looks() -> None:
    for hertz, looks in product((1, 5, 20, 1000), (0.1, 0.37, 3.0)):
        rates, shown, due = SourceRates(), 0.0, looks
        for count in range(1, hertz * 6 + 1):
            now = count / hertz
            rates.record("me", 4, now)
            if now >= due:
                shown, due = reported(rates, now)["me"], due + looks
        assert shown == pytest.approx(hertz, rel=0.1, abs=1.0), looks


def test_one_command_is_one_hertz_and_soon_none(rates: SourceRates) -> None:
    rates.record("me", 4, 10.0)
    assert reported(rates, 10.0)["me"] == 1
    assert reported(rates, 10.9)["me"] == 1
    assert reported(rates, 12.5)["me"] < 0.5


def test_a_source_that_is_silent_for_some_seconds_is_forgotten(rates: SourceRates) -> None:
    rates.record("me", 4, 10.0)
    assert "me" in reported(rates, 10.0 + RECENT)
    assert reported(rates, 10.01 + RECENT) == {}


def test_the_strongest_come_first(rates: SourceRates) -> None:
    for source, rank in (("b", 4), ("c", 5), ("a", 4), ("d", 1)):
        rates.record(source, rank, 1.0)
    assert [source for source, *_ in rates.recent(1.0)] == ["d", "a", "b", "c"]


def test_a_flood_of_names_leaves_the_newest(rates: SourceRates) -> None:
    for number in range(1000):
        rates.record(f"n{number}", 4, number * 1e-3)
    assert {source for source, *_ in rates.recent(1.0)} == {
        f"n{number}" for number in range(1000 - MAX_RATES, 1000)
    }
