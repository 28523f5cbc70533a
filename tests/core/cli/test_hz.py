"""Rates, sizes and delays follow from arrivals, sizes and stamps, with what was lost on the way."""

import random
import statistics

import pytest

from holozen.cli.stats import (
    SimClock,
    Window,
    bandwidth,
    jitter,
    lost,
    percentile,
    rate,
    rate_text,
    size,
    spread,
    stamp_of,
)
from holozen.transport.samples import Sample


def test_a_rate_is_reported_with_its_gaps() -> None:
    reported = rate([10.0, 10.1, 10.3])
    assert reported["rate"] == pytest.approx(1 / 0.15)
    assert (reported["min"], reported["max"], reported["jitter"]) == pytest.approx((0.1, 0.2, 0.1))
    assert rate_text(reported | {"lost": 2}).splitlines() == [
        "average rate: 6.667",
        "\tmin: 0.1000s max: 0.2000s std dev: 0.05000s window: 3",
        "\tp50: 0.1000s p95: 0.2000s p99: 0.2000s jitter: 0.10000s lost: 2",
    ]
    assert "lost" not in rate_text(reported | {"lost": None})


def test_arrivals_at_one_instant_divide_by_nothing_and_one_is_no_rate() -> None:
    assert rate([1.0, 1.0])["rate"] == 0.0
    assert rate([1.0]) == rate([]) == {}


def test_a_spread_equals_that_of_the_standard_library() -> None:
    values = [random.Random(7).gauss(5, 2) for _ in range(1000)]
    reported = spread(values)
    assert reported["mean"] == pytest.approx(statistics.fmean(values))
    assert reported["std_dev"] == pytest.approx(statistics.pstdev(values))
    assert (reported["min"], reported["max"]) == (min(values), max(values))


def test_a_percentile_is_the_nearest_rank() -> None:
    for rank, value in [(50, 50), (95, 95), (99, 99), (100, 100), (0, 1)]:
        assert percentile([float(i) for i in range(1, 101)], rank) == value
        assert percentile([3.0], rank) == 3.0


def test_jitter_is_the_mean_step_from_one_to_the_next() -> None:
    assert jitter([1.0, 3.0, 2.0]) == 1.5
    assert jitter([1.0]) == 0.0


def test_holes_in_the_numbers_of_each_source_are_lost_samples() -> None:
    assert lost([("a", 1), ("a", 2), ("a", 5), ("b", 9)]) == 2
    assert lost([("a", 5), ("a", 4), ("a", 4)]) == 0  # late or twice is not lost
    assert lost([]) == 0


class Numbered(Sample):
    """A sample of a size that came from nowhere."""

    __slots__ = ("number",)

    def __init__(self, size: int, number: int | None = None) -> None:
        self.oversize, self.payload = size, b""
        self.number = None if number is None else ("a", number)  # type: ignore[misc]


def window(*sizes: int) -> Window:
    made = Window(10)
    for at, each in enumerate(sizes):
        made.add(Numbered(each, at * 2), float(at), float(each))
    return made


def test_a_bandwidth_is_the_bytes_of_all_but_the_first_over_their_time() -> None:
    reported = bandwidth(window(1000, 100, 300))
    assert reported["bytes_per_second"] == 200.0
    assert (reported["min"], reported["max"], reported["window"]) == (100, 1000, 3)
    assert bandwidth(window(1000)) == {}


def test_a_window_counts_lost_messages_by_their_numbers() -> None:
    assert window(1, 1, 1).lost() == 2
    assert lost([("teleop", number) for number in (40, 41, 43, 0, 1, 2)]) == 1
    silent = Window(10)
    silent.add(Numbered(1), 0.0, 1.0)
    assert silent.lost() is None


def test_bytes_are_shown_in_a_readable_unit() -> None:
    for count, expected in [
        (0, "0 B"),
        (999, "999 B"),
        (1000, "1.00 KB"),
        (2_500_000, "2.50 MB"),
        (5e9, "5.00 GB"),
    ]:
        assert size(count) == expected


def test_the_sims_time_goes_on_between_two_messages_at_the_sims_pace() -> None:
    clock = SimClock()
    assert clock.time(0.0) is None
    for step in range(100):  # half of real time
        clock.see(step * 0.01, step * 0.02)
    assert clock.time(99 * 0.02) == pytest.approx(0.99)
    assert clock.time(99 * 0.02 + 0.1) == pytest.approx(0.99 + 0.05, abs=1e-3)


def test_what_has_no_stamp_has_no_age() -> None:
    rows: list[object] = [
        None,
        [],
        "text",
        {},
        {"header": None},
        {"header": {"stamp": 3}},
        {"header": {"stamp": {"sec": "1"}}},
        {"header": {"stamp": {"sec": 0, "nanosec": 0}}},
    ]
    for value in rows:
        assert stamp_of(value) is None


def test_a_stamp_is_read_in_seconds() -> None:
    assert stamp_of({"header": {"stamp": {"sec": 12, "nanosec": 500_000_000}}}) == 12.5
