"""The age of a command counts from its sending: none that was held up in a slow link, or by a
relay, moves a robot.

Each side has a monotonic clock of its own. Delays are those of a proxy. `test_cuts.py` has links
that are cut.
"""

import os
import random
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count

import pytest

from holozen.messages import CommandStatus, Odometry, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import run
from holozen.testing.wire import command
from holozen.transport.samples import Sample

from .history import CLOCK, EACH_STEP, MOVES, History, script, wait_for_motion, wait_for_odom
from .namespaces import NEEDS, Lab
from .proxy import Proxy

pytestmark = NEEDS

DELAYS = [(0.15, True), (0.4, False), (0.1, True)]
"""Delays of a link in s, one way, one after another; and whether the robot is driven over it: a
command's echo is a round trip old.
"""
if os.environ.get("HOLOZEN_LONG") == "1":
    DELAYS += [(2.0, False), (0.05, True), (1.0, False), (0.1, True)]
APART = 0.0001  # m/s between a command and the next


class Far:
    """A sim, and a driver behind a proxy with a clock of its own."""

    def __init__(self, wire: Wire, proxy: Proxy, lab: Lab) -> None:
        self.proxy, self.desk = proxy, lab.host("desk", clock=CLOCK)
        self.observer = Process(script("observer", wire.endpoint))
        words = [
            word for word in self.desk.inside(*script("driver", proxy.endpoint)) if word != "-n"
        ]
        self.driver = Process(words)

    def history(self) -> History:
        return History.of([self.driver], self.observer, CLOCK)

    def wait_for_motion(self, since: float, moves: bool = True) -> None:
        wait_for_motion(self.observer, since, moves)

    def wait_for_odom(self, at: float) -> None:
        wait_for_odom(self.observer, at)


@pytest.fixture(scope="module")
def town() -> Iterator[Wire]:
    """A sim that tells of each of its steps."""
    with Wire() as wire:
        wire.start("sim").wait_for_line("listens on cmd_vel")
        assert wire.run(*EACH_STEP).returncode == 0
        yield wire


@pytest.fixture
def far(town: Wire, lab: Lab) -> Iterator[Far]:
    with Proxy(town.port) as proxy:
        far = Far(town, proxy, lab)
        with far.observer, far.driver:
            far.wait_for_motion(0.0)
            yield far


def test_a_link_that_becomes_slow_stops_the_robot_and_a_late_stop_is_obeyed(far: Far) -> None:
    for delay, drives in DELAYS:
        far.proxy.set(delay=delay)
        begin = time.monotonic() + 2 * delay + 1.5
        if drives:
            far.wait_for_motion(begin)
        else:
            far.wait_for_odom(begin + 1)
            assert not far.history().moves(begin), f"with a delay of {delay} s"
        far.history().check_silence()
    far.driver.terminate()
    far.wait_for_motion(time.monotonic(), False)


def test_a_stricter_limit_refuses_what_a_slow_link_brings(far: Far, town: Wire) -> None:
    far.proxy.set(delay=0.2)
    far.wait_for_odom(time.monotonic() + 1.5)
    assert town.run("param", "set", "sim", "max_command_age", "0.1").returncode == 0
    begin = time.monotonic() + 1.0
    far.wait_for_odom(begin + 1.0)
    assert not far.history().moves(begin)
    assert town.run("param", "set", "sim", "max_command_age", "0.5").returncode == 0
    far.wait_for_motion(time.monotonic())


def test_a_link_that_jitters_moves_the_robot_only_by_what_is_fresh(
    far: Far, trials: Callable[[int, int], int]
) -> None:
    far.proxy.set(delay=0.1, jitter=0.4)
    far.wait_for_odom(time.monotonic() + trials(2, 20))
    far.driver.kill()
    far.wait_for_odom(time.monotonic() + 2)
    far.history().check_silence()


def test_a_link_of_64_kbit_per_second_drives_and_a_slower_one_moves_the_robot_only_by_what_is_fresh(
    far: Far,
) -> None:
    far.proxy.upstream.rate = 8000  # bytes/s
    far.wait_for_motion(time.monotonic() + 1.0)
    # less than the driver sends, so that its commands wait longer and longer
    far.proxy.upstream.rate = 2000
    far.wait_for_motion(time.monotonic(), False)
    assert far.driver.returncode is None
    far.driver.kill()
    far.wait_for_odom(time.monotonic() + 2)
    far.history().check_silence()
    assert not far.history().odom[-1].moves


def test_commands_that_a_relay_reorders_never_go_back(town: Wire) -> None:
    """It holds some back and sends them on in another order, each with the stamp of its sender.

    A speed tells the number of its command. Until a robot has settled, the engine's contacts add
    some 1e-9 m/s to what is commanded; from then on odom has the command itself.
    """
    bus, relay = town.bus("driver"), town.bus("relay")
    commands, waiting = bus.publisher("relayed", Twist), relay.subscribe_raw("relayed")
    commands.echoes = bus.echoes("cmd_vel")  # it commands the robot, by way of the relay
    odom, status = (
        bus.subscribe("odom", Odometry, depth=10_000),
        bus.latest("cmd_vel_status", CommandStatus),
    )
    steps = count(1)
    speeds: list[float] = []
    wait_for(lambda: commands.matched)

    def send(speed: float) -> Sample:
        commands.put(Twist.planar(speed))
        return wait_for(waiting.try_recv) or pytest.fail("no command to relay")

    def seen() -> list[float]:
        while (received := odom.try_recv()) is not None:
            speeds.append(received.message.twist.twist.linear.x if received.message else 0.0)
        return speeds

    def pass_on(samples: list[Sample]) -> None:
        """Each when some steps have shown what became of the one before."""
        for sample in samples:
            relay.session.put(
                "cmd_vel", sample.payload, encoding=sample.encoding, attachment=sample.attachment
            )
            wait_for(partial(lambda enough: len(seen()) >= enough, len(seen()) + 3), what="odom")

    def reordered() -> bool:
        held = [send(0.1 + APART * next(steps)) for _ in range(3)]
        random.shuffle(held)
        pass_on(held)
        read = status.read()[0]
        return bool(max(speeds) > 0.1 and read and read.refused.get("out of order", 0) > 20)

    wait_for(reordered, 30, lambda: f"commands out of order; {status.read()[0]}")
    obeyed = [(each - 0.1) / APART for each in speeds if each > MOVES]
    assert obeyed == pytest.approx(numbers := [*map(round, obeyed)], abs=0.01)
    assert numbers == sorted(numbers)
    late, stop = send(1.0), send(0.0)
    pass_on([stop, late])
    wait_for(lambda: seen()[-1] < MOVES, 20, "a robot that stands")
    del speeds[:]
    pass_on([late] * 3)
    wait_for(lambda: len(seen()) > 20)
    assert max(speeds) < MOVES


def test_topic_pub_drives_over_a_link_whose_round_trip_takes_a_quarter_of_a_second(
    town: Wire,
) -> None:
    """Its first command is late, and what it asks about that holds up none that follow."""
    with Proxy(town.port) as proxy:
        proxy.set(delay=0.12)
        words = command(
            "topic",
            "pub",
            "cmd_vel",
            "{linear: {x: 0.2}}",
            "--mode",
            "client",
            "--connect",
            proxy.endpoint,
        )
        for often in (["--once"], ["-r", "20", "--times", "30"]):
            drives = partial(run, [*words, *often], 30.0)
            wait_for(lambda drives=drives: drives().returncode == 0, what=f"motion by {often}")  # type: ignore[misc]
