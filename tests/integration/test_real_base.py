"""LeKiwi's base of the examples on a simulated port: it keeps what bases promise; its wheels stop, whatever ends it."""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from holozen.messages import Odometry, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.testing.conformance import PROMISES, Probe, name

FOLDER = Path(__file__).parents[2] / "examples" / "lekiwi"
STANDS = "7:0 8:0 9:0"


class Kiwi:
    """The base, its servos, and a wire."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.servos = Process([sys.executable, str(FOLDER / "simulated_servos.py")])
        self.port = self.servos.wait_for_line("/dev/")
        self.base = Process([sys.executable, str(FOLDER / "lekiwi.py"), self.port, *wire.flags])
        self.base.wait_for_line("drives the servos")

    def close(self) -> None:
        self.base.close()
        self.servos.close()

    def speeds(self) -> str:
        return self.servos.out.splitlines()[-1]

    def drive(self, commands: Any) -> None:
        """Command until the wheels turn."""
        forward = Twist.planar(0.1)
        wait_for(lambda: commands.put(forward) or self.speeds() != STANDS)


@pytest.fixture(scope="module")
def kiwi() -> Iterator[Kiwi]:
    with Wire() as wire:
        kiwi = Kiwi(wire)
        yield kiwi
        kiwi.close()


@pytest.fixture(scope="module")
def probe(kiwi: Kiwi) -> Probe:
    return Probe(kiwi.wire.bus)


@pytest.fixture
def own(wire: Wire) -> Iterator[Kiwi]:
    """A base of the test's own, which it may end."""
    kiwi = Kiwi(wire)
    yield kiwi
    kiwi.close()


@pytest.mark.parametrize("promise", PROMISES, ids=name)
def test_it_keeps_every_promise(promise: Callable[[Probe], None], probe: Probe) -> None:
    promise(probe)


def test_its_wheels_turn_as_those_of_an_omni_base_and_its_odometry_says_so(kiwi: Kiwi, probe: Probe) -> None:
    odom = kiwi.wire.bus("reader").latest("odom", Odometry)
    commands = kiwi.wire.bus("driver").publisher("cmd_vel", Twist)
    for velocity, speeds in (
        # m/s over 0.05 m, in steps/s: the left and the right wheel roll at 30 degrees from forward, the back one aside
        ((0.1, 0.0, 0.0), "7:-1129 8:0 9:1129"),
        ((0.0, 0.1, 0.0), "7:652 8:-1304 9:652"),
        ((0.0, 0.0, 0.5), "7:815 8:815 9:815"),
    ):
        wanted = Twist.planar(*velocity)

        def drives(wanted: Twist = wanted, speeds: str = speeds) -> bool:
            commands.put(wanted)
            newest, _ = odom.read()
            twist = newest.twist.twist if newest else Twist()
            found = (twist.linear.x, twist.linear.y, twist.angular.z)
            return kiwi.speeds() == speeds and found == pytest.approx(
                (wanted.linear.x, wanted.linear.y, wanted.angular.z), abs=1e-3
            )

        wait_for(drives, what=f"wheels that turn at {speeds}")
    commands.put(Twist())
    probe.rest("after a zero")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL, signal.SIGSTOP])
def test_its_wheels_stop_whatever_ends_or_holds_it(number: signal.Signals, own: Kiwi) -> None:
    own.drive(own.wire.bus().publisher("cmd_vel", Twist))
    own.base.signal(number)
    wait_for(lambda: own.speeds() == STANDS, what="the wheels to stop")
    if number in (signal.SIGINT, signal.SIGTERM):
        assert own.base.wait() == 0
    own.servos.signal(0)  # which still run


def test_a_port_without_servos_is_reported_in_one_line(wire: Wire) -> None:
    here, there = os.openpty()
    try:
        for port, reason in (
            ("/dev/none", "lekiwi: cannot open /dev/none: No such file or directory"),
            (os.ttyname(there), "does not answer: is it powered, is that its id?"),
        ):
            base = Process([sys.executable, str(FOLDER / "lekiwi.py"), port, *wire.flags])
            assert base.wait() == 1
            assert reason in base.err
            assert len(base.err.splitlines()) == 1
            base.close()
    finally:
        os.close(here)
        os.close(there)
