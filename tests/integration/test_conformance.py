"""The conformance test of bases: the sim passes it, and a base that lacks one of its rules is told
which.
"""

import math
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from holozen.messages import (
    Header,
    Odometry,
    Pose,
    PoseWithCovariance,
    Time,
    TriggerReply,
    TriggerRequest,
    Twist,
)
from holozen.messages.geometry_msgs import Point, TwistWithCovariance
from holozen.testing import Wire, conformance
from holozen.testing.conformance import PROMISES, Probe, name
from holozen.transport.errors import BusError

from .conftest import start_sim


@pytest.fixture(scope="module")
def town() -> Iterator[Wire]:
    with Wire() as wire:
        start_sim(wire)
        yield wire


@pytest.fixture(scope="module")
def probe(town: Wire) -> Probe:
    return Probe(town.bus)


def test_the_command_line_reports_what_is_wrong_in_one_line(
    wire: Wire, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        conformance.main(["--speed", "2", *wire.flags])
    assert end.value.code == 2
    assert "use a number from 0.01 to 1 m/s" in capsys.readouterr().err
    words = (sys.executable, "-m", "holozen.testing.conformance")
    nobody = [*words, "Nobody", "--wait", "0.2", *wire.flags]
    done = subprocess.run(nobody, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith("start its base")


class Naive:
    """A base as one writes it in an evening. `lacks` is the rule that was forgotten."""

    def __init__(self, wire: Wire, lacks: str) -> None:
        self._lacks, self._bus, self._stopped = lacks, wire.bus("naive"), False
        self._commands = self._bus.subscribe("cmd_vel", Twist)
        self._odom = self._bus.publisher("odom", Odometry)
        if lacks != "stop":
            self._bus.serve(
                "stop", TriggerRequest, TriggerReply, lambda _: self._stop(True)
            ).start()
            self._bus.serve(
                "release", TriggerRequest, TriggerReply, lambda _: self._stop(False)
            ).start()
            self._bus.serve(
                "resume", TriggerRequest, TriggerReply, lambda _: TriggerReply(True)
            ).start()

    def _stop(self, stopped: bool) -> TriggerReply:
        self._stopped = stopped
        return TriggerReply(True)

    def live(self, end: threading.Event) -> None:
        x, speed, heard, person, before, late = (
            0.0,
            0.0,
            -math.inf,
            -math.inf,
            time.monotonic(),
            0.0,
        )
        while not end.wait(0.2 if self._lacks == "rate" else 0.02):
            now = time.monotonic()
            for received in iter(self._commands.try_recv, None):
                is_person = received.priority == "INTERACTIVE_HIGH"
                wanted = received.message.linear.x if received.message else 0.0
                if self._lacks == "check":
                    wanted = max(-1.0, min(1.0, wanted))  # 1 for NaN
                elif not abs(wanted) < 1:
                    continue
                if is_person or now - person > 0.5 or self._lacks == "priority":
                    speed, heard, person = wanted, now, now if is_person else person
            if self._stopped or (now - heard > 0.5 and self._lacks != "watchdog"):
                speed = 0.0
            x += speed * (now - before) * (3 if self._lacks == "scale" else 1)
            late, before = (late if self._lacks == "stamps" else now), now
            pose = PoseWithCovariance(Pose(Point(x)))
            twist = TwistWithCovariance(Twist.planar(speed))
            self._odom.put(Odometry(Header(Time.of(late), "odom"), "base_link", pose, twist))


LACKS = {
    "watchdog": ("it_obeys_and_stops_in_silence", "is there a watchdog"),
    "check": ("it_refuses_impossible_speeds", "moves at 1 m/s after a speed of nan"),
    "priority": ("a_person_comes_first", "while a person commands|the robot to move back"),
    "stop": ("it_stands_while_it_is_stopped", "no reply from 'stop'"),
    "rate": ("its_odometry_is_steady_and_agrees_with_itself", "at least 10 Hz"),
    "stamps": ("its_odometry_is_steady_and_agrees_with_itself", "stamps do not increase"),
    "scale": ("its_odometry_is_steady_and_agrees_with_itself", "its pose moved"),
}
"""By the rule that a base lacks: the promise that it breaks, and what is said of it."""


def test_a_base_without_a_rule_is_told_which() -> None:
    with ThreadPoolExecutor(len(LACKS)) as pool:  # most of the time each only waits
        told = dict(zip(LACKS, pool.map(told_of, LACKS), strict=True))
    for lacks, (_, reason) in LACKS.items():
        assert re.search(reason, told[lacks]), f"without {lacks}: {told[lacks]}"


def told_of(lacks: str) -> str:
    """What a base that lacks a rule is told, on a wire of its own."""
    end = threading.Event()
    with Wire() as wire:
        naive = threading.Thread(target=Naive(wire, lacks).live, args=(end,))
        naive.start()
        try:
            getattr(conformance, LACKS[lacks][0])(Probe(wire.bus))
        except (AssertionError, BusError) as error:
            return str(error)
        finally:
            end.set()
            naive.join()
    return "nothing"


@pytest.mark.parametrize("promise", PROMISES, ids=name)
def test_the_sim_keeps_every_promise(promise: Any, probe: Probe) -> None:
    promise(probe)
