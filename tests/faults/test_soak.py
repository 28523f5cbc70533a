"""Random acts of every kind, for a while, break no promise; see soak.py."""

import os

import pytest

from .soak import soak

LONG = os.environ.get("HOLOZEN_LONG") == "1"
MINUTES = 10.0 if LONG else 0.1


@pytest.mark.timeout(120 + 90 * MINUTES)
def test_a_soak_breaks_no_promise() -> None:
    run, _ = soak(MINUTES, seed := int.from_bytes(os.urandom(3)))
    assert run.wrong == [], f"seed {seed}"
    memory, threads, descriptors = run.growth()
    print(f"memory {memory:+.1f} MB/h, see docs/evidence.md")
    if LONG:
        assert abs(threads) < 5 and abs(descriptors) < 10, run.figures
