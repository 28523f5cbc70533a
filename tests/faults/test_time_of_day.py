"""The time of day may jump by an hour while a robot is driven: no safety rule depends on it."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.testing import Process, Wire, wait_for
from holozen.transport.graph import ALL_NODE_INFO

from .history import STEP, History

# Alone, for the observer's clock dates what it receives, once the sim's has jumped.
pytestmark = [pytest.mark.needs("faketime"), pytest.mark.alone]

HERE = Path(__file__).parent
HOUR = 3600.0
SLEEP = """
import threading, time
pause = threading.Event()
time.sleep = lambda seconds: pause.wait(seconds) and None
"""
"""Under faketime Python's own time.sleep fails."""


class Clock:
    """The time of day of one process, by Debian's faketime; its monotonic clock stays."""

    def __init__(self, folder: Path) -> None:
        self._file = file = folder / "clock"
        self.set(0.0)
        (folder / "sitecustomize.py").write_text(SLEEP)
        asked = subprocess.run(
            ["faketime", "-m", "-f", "+0", "sh", "-c", "echo $LD_PRELOAD"],
            capture_output=True,
            text=True,
        )
        self.env = {
            "LD_PRELOAD": asked.stdout.strip(),
            "FAKETIME_TIMESTAMP_FILE": str(file),
            "FAKETIME_NO_CACHE": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
            "PYTHONPATH": str(folder),
        }

    def set(self, ahead: float) -> None:
        """Set the clock so many seconds ahead of this machine's."""
        new = self._file.with_suffix(".new")
        new.write_text(f"{ahead:+.0f}\n")
        new.replace(self._file)


@pytest.fixture
def clock(tmp_path: Path) -> Clock:
    return Clock(tmp_path)


@pytest.fixture
def observer(wire: Wire, clock: Clock) -> Iterator[Process]:
    wire.start("sim", env=clock.env).wait_for_line("listens on cmd_vel", 60)
    assert wire.run("param", "set", "sim", "odometry_rate", f"{1 / STEP:g}").returncode == 0
    with Process([sys.executable, str(HERE / "observer.py"), wire.endpoint]) as observer:
        yield observer


def ahead(bus: Bus) -> float:
    """By how many seconds the sim's time of day is ahead."""
    for reply in bus.ask_all(ALL_NODE_INFO, 5.0):
        if not isinstance(reply, bytes) and (about := json.loads(reply.payload))["node"] == "sim":
            return float(about["time"]) - time.time()
    return 0.0


def test_a_robot_is_driven_on_and_stopped_in_time_though_the_time_of_day_jumps(
    wire: Wire, clock: Clock, observer: Process
) -> None:
    bus, words = wire.bus(), [sys.executable, str(HERE / "driver.py"), wire.endpoint]
    with Process(words) as driver:

        def history() -> History:
            return History.of([driver], observer, 0.0)

        for jump in (HOUR, -HOUR, 0.0):
            clock.set(jump)
            wait_for(lambda jump=jump: abs(ahead(bus) - jump) < 60, what="the jump to hit")  # type: ignore[misc]
            since = time.monotonic()
            wait_for(lambda since=since: history().moves(since), 20, "a robot that moves")  # type: ignore[misc]
        clock.set(HOUR)
        driver.kill()
        killed = time.monotonic()
        wait_for(lambda: (odom := history().odom) and odom[-1].end > killed + 1, 20, "odom")
        history().check_silence()
        assert not history().odom[-1].moves
