"""The rate is what the gaps between arrivals say."""

from holozen.cli.hz import rate


def test_a_rate_is_told_with_its_gaps() -> None:
    told = rate([10.0, 10.1, 10.3])
    assert told == "average rate: 6.667\n\tmin: 0.1000s max: 0.2000s std dev: 0.05000s window: 3"


def test_arrivals_at_one_instant_divide_by_nothing() -> None:
    assert rate([1.0, 1.0]).startswith("average rate: 0.000\n")
