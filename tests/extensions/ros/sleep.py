"""When a thread that sleeps by a clock has begun to."""

import threading

import pytest

from holozen.ros.rclpy.clock import Clock


def sleeping(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Set once somebody sleeps by that clock."""
    asleep, wait_seconds = threading.Event(), clock.wait_seconds

    def wait(until: int) -> float | None:
        asleep.set()
        return wait_seconds(until)

    monkeypatch.setattr(clock, "wait_seconds", wait)
    return asleep
