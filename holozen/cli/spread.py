"""What many numbers say together: mean, extremes, percentiles, jitter. Pure functions of lists."""

import math
from itertools import pairwise

PERCENTILES = (50, 95, 99)


def spread(values: list[float]) -> dict[str, float]:
    """mean, min, max, std_dev (of all, not a sample), p50, p95, p99 of at least one value."""
    ordered, mean = sorted(values), sum(values) / len(values)
    deviation = math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
    told = {"mean": mean, "min": ordered[0], "max": ordered[-1], "std_dev": deviation}
    return told | {f"p{rank}": percentile(ordered, rank) for rank in PERCENTILES}


def percentile(ordered: list[float], rank: float) -> float:
    """The smallest of the sorted values that at least `rank` % of them do not exceed (the nearest rank)."""
    return ordered[max(0, math.ceil(len(ordered) * rank / 100) - 1)]


def jitter(values: list[float]) -> float:
    """By how much a value differs from the one before, on average: RFC 3550's |D(i-1, i)|, not smoothed."""
    steps = [abs(later - earlier) for earlier, later in pairwise(values)]
    return sum(steps) / len(steps) if steps else 0.0


def lost(numbers: list[tuple[str, int]]) -> int:
    """How many samples are missing between the first and the last of each source; `numbers` as Sample.number gives."""
    seen: dict[str, set[int]] = {}
    for source, number in numbers:
        seen.setdefault(source, set()).add(number)
    return sum(max(its) - min(its) + 1 - len(its) for its in seen.values())
