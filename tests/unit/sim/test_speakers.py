"""Who spoke lately: bounded, and counted over the last second."""

import pytest

from services.sim.speakers import LATELY, MOST, Speakers


@pytest.fixture
def speakers() -> Speakers:
    return Speakers()


def rates(speakers: Speakers, now: float) -> dict[str, float]:
    return {source: rate for source, _, rate in speakers.lately(now)}


@pytest.mark.parametrize("hertz", [1, 5, 20, 1000])
@pytest.mark.parametrize("looks", [0.1, 0.37, 3.0])
def test_the_rate_is_that_of_the_last_second_or_so_however_often_one_looks(
    speakers: Speakers, hertz: int, looks: float
) -> None:
    told, due = 0.0, looks
    for count in range(1, hertz * 6 + 1):
        now = count / hertz
        speakers.hear("me", 4, now)
        if now >= due:
            told, due = rates(speakers, now)["me"], due + looks
    assert told == pytest.approx(hertz, rel=0.1, abs=1.0)


def test_one_command_is_one_hertz_and_soon_none(speakers: Speakers) -> None:
    speakers.hear("me", 4, 10.0)
    assert rates(speakers, 10.0)["me"] == 1
    assert rates(speakers, 10.9)["me"] == 1
    assert rates(speakers, 12.5)["me"] < 0.5


def test_who_is_silent_for_some_seconds_is_forgotten(speakers: Speakers) -> None:
    speakers.hear("me", 4, 10.0)
    assert "me" in rates(speakers, 10.0 + LATELY)
    assert rates(speakers, 10.01 + LATELY) == {}


def test_the_strongest_come_first(speakers: Speakers) -> None:
    for source, rank in (("b", 4), ("c", 5), ("a", 4), ("d", 1)):
        speakers.hear(source, rank, 1.0)
    assert [source for source, _, _ in speakers.lately(1.0)] == ["d", "a", "b", "c"]


def test_a_flood_of_names_leaves_the_newest(speakers: Speakers) -> None:
    for number in range(1000):
        speakers.hear(f"n{number}", 4, number * 1e-3)
    assert {source for source, _, _ in speakers.lately(1.0)} == {f"n{number}" for number in range(1000 - MOST, 1000)}
