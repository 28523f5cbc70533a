"""The age of a command counts from its sending: none that was held up moves a robot, even if its sender has died.

Each side has a monotonic clock of its own. Cuts are links that are set down between network namespaces, delays are
those of a proxy.
"""

import os
import random
import signal
import sys
import time
from collections.abc import Iterator
from functools import partial
from itertools import count

import pytest

from holozen.messages import CommandStatus, Odometry, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command, free_port
from holozen.transport.samples import Sample

from .history import CLOCK, EACH_STEP, MOVES, History, newest, script
from .namespaces import NEEDS, Cable, Host, Lab
from .proxy import Proxy

pytestmark = NEEDS

LONG = os.environ.get("HOLOZEN_LONG") == "1"
TRIALS = 34 if LONG else 1  # of each cut and fate, so some hundred of each cut
CUTS = (0.2, 0.6, 0.9, 2.0)  # s
LONG_CUTS = (15.0, 60.0) if LONG else ()  # s, once each
DELAYS = [(0.1, True), (0.4, True), (0.6, False), (2.0, False), (0.1, True)]
"""Delays of a link in s, one way, one after another; and whether the robot is driven over it."""
APART = 0.0001  # m/s between a command and the next
if LONG:
    DELAYS += [(0.2, True), (1.0, False), (0.1, True)]


class Course:
    """A sim on one host, its drivers on another, and what was seen of both."""

    def __init__(self, lab: Lab) -> None:
        self.robot: Host = lab.host("robot")
        self.desk: Host = lab.host("desk", clock=CLOCK)
        self.cable: Cable = lab.cable(self.robot, self.desk)
        port = free_port()
        at = f"tcp/{self.cable.address(self.robot)}:{port}"
        self.endpoint, here = at, f"tcp/127.0.0.1:{port}"
        words = command("sim", "--listen", f"tcp/0.0.0.0:{port}", "--connect", here)
        self.robot.start(*words).wait_for_line("listens on cmd_vel")
        self.robot.check(*command(*EACH_STEP, "--connect", here))
        self.observer = self.robot.start(*script("observer", here))
        self.drivers: list[Process] = []

    def drive(self) -> Process:
        """Start a driver, and wait until the robot moves."""
        began = time.monotonic()
        driver = self.desk.start(*script("driver", self.endpoint))
        self.drivers.append(driver)
        self.wait_for_motion(began)
        return driver

    def history(self) -> History:
        return History.of(self.drivers, self.observer, CLOCK)

    def wait_for_motion(self, since: float, within: float = 20.0) -> None:
        wait_for(lambda: self.history().moves(since), within, "a robot that moves")

    def wait_for_odom(self, at: float) -> None:
        wait_for(lambda: newest(self.observer) > at, 20.0, "odom")


@pytest.fixture(scope="module")
def course() -> Iterator[Course]:
    with Lab() as lab:
        yield Course(lab)


@pytest.mark.timeout(60 + 15 * TRIALS * len(CUTS) + 2 * sum(LONG_CUTS))
@pytest.mark.parametrize("fate", ["alive", "killed", "stopped"])
def test_after_a_cut_nothing_that_waited_moves_the_robot(course: Course, fate: str) -> None:
    longest = away = 0.0
    for cut in (*CUTS * TRIALS, *LONG_CUTS):
        driver = course.drive()
        course.cable.cut()
        began = time.monotonic()
        time.sleep(random.uniform(0.0, cut))  # the fate meets it anywhere in the cut
        if fate == "killed":
            driver.kill()
        elif fate == "stopped":
            driver.signal(signal.SIGSTOP)
        time.sleep(max(0.0, began + cut - time.monotonic()))
        restored = time.monotonic()
        course.cable.join()
        if fate == "alive":
            course.wait_for_motion(restored)
            away = max(away, course.history().moves(restored)[0].begin - restored)
        course.wait_for_odom(restored + 1.0)
        resumed = time.monotonic()
        driver.signal(signal.SIGCONT)
        driver.close()
        history = course.history()
        if cut > 0.5:
            assert not history.moves(began + 0.55, restored), "the cut did not hit"
        history.check_silence(began)
        history.check_restored(restored, resumed)
        longest = max(longest, history.longest(began))
        course.drivers, course.observer = [], restart(course)
    print(f"{fate}: moved on for at most {longest:.3f} s after the last command was sent")
    print(f"{fate}: driven again at most {away:.3f} s after the link came back")


@pytest.mark.needs("nft")
@pytest.mark.parametrize("fate", ["alive", "killed"])
def test_after_a_cut_that_neither_end_sees_nothing_moves_the_robot_either(course: Course, fate: str) -> None:
    """Packets are dropped both ways: links stay half-open, and no end of a process comes through."""
    driver = course.drive()
    course.cable.lose(1.0)
    began = time.monotonic()
    time.sleep(0.58)  # TCP sends what waits again 0.2, 0.6 and 1.4 s later
    if fate == "killed":
        driver.kill()
    restored = time.monotonic()
    course.cable.lose(0.0)
    if fate == "alive":
        course.wait_for_motion(restored)
    course.wait_for_odom(restored + 1.5)
    driver.close()
    history = course.history()
    assert not history.moves(began + 0.55, restored), "the cut did not hit"
    history.check_silence(began)
    history.check_restored(restored)
    course.drivers, course.observer = [], restart(course)


@pytest.mark.needs("nft")
def test_where_a_third_of_the_packets_is_lost_nothing_old_moves_the_robot(course: Course) -> None:
    driver = course.drive()
    began, before = time.monotonic(), sent_again(course.desk)
    course.cable.lose(0.3)
    wait_for(lambda: sent_again(course.desk) > before + 5, 30.0, "packets that were lost and sent again")
    driver.kill()
    course.cable.lose(0.0)
    course.wait_for_odom(time.monotonic() + 1.0)
    history = course.history()
    history.check_silence(began)
    assert not history.odom[-1].moves
    course.drivers, course.observer = [], restart(course)


def sent_again(host: Host) -> int:
    """How many TCP segments a host has retransmitted."""
    names, values = (line.split() for line in host.proc_net("snmp") if line.startswith("Tcp:"))
    return int(values[names.index("RetransSegs")])


def restart(course: Course) -> Process:
    """Start another observer, so that a history stays short."""
    course.observer.close()
    words = course.observer.words
    return course.robot.start(*words[words.index(sys.executable) :])


class Far:
    """A sim, and a driver behind a proxy with a clock of its own."""

    def __init__(self, wire: Wire, proxy: Proxy, lab: Lab) -> None:
        self.proxy, self.desk = proxy, lab.host("desk", clock=CLOCK)
        wire.start("sim").wait_for_line("listens on cmd_vel")
        assert wire.run(*EACH_STEP).returncode == 0
        self.observer = Process(script("observer", wire.endpoint))
        words = [word for word in self.desk.inside(*script("driver", proxy.endpoint)) if word != "-n"]
        self.driver = Process(words)

    def history(self) -> History:
        return History.of([self.driver], self.observer, CLOCK)

    def wait_for_motion(self, since: float) -> None:
        wait_for(lambda: self.history().moves(since), what="a robot that moves")

    def wait_for_odom(self, at: float) -> None:
        wait_for(lambda: newest(self.observer) > at, what="odom")


@pytest.fixture
def far(wire: Wire, proxy: Proxy, lab: Lab) -> Iterator[Far]:
    far = Far(wire, proxy, lab)
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
    wait_for(lambda: not far.history().odom[-1].moves, 5.0, "a robot that stands")


def test_a_stricter_limit_refuses_what_a_slow_link_brings(far: Far, wire: Wire) -> None:
    far.proxy.set(delay=0.2)
    far.wait_for_odom(time.monotonic() + 1.5)
    assert wire.run("param", "set", "sim", "max_command_age", "0.1").returncode == 0
    begin = time.monotonic() + 1.0
    far.wait_for_odom(begin + 1.0)
    assert not far.history().moves(begin)
    assert wire.run("param", "set", "sim", "max_command_age", "0.5").returncode == 0
    far.wait_for_motion(time.monotonic())


def test_a_link_that_jitters_moves_the_robot_only_by_what_is_fresh(far: Far) -> None:
    far.proxy.set(delay=0.1, jitter=0.4)
    far.wait_for_odom(time.monotonic() + 5)
    far.driver.kill()
    far.wait_for_odom(time.monotonic() + 2)
    far.history().check_silence()


def test_a_link_of_64_kbit_per_second_drives_and_a_slower_one_moves_the_robot_only_by_what_is_fresh(far: Far) -> None:
    far.proxy.upstream.rate = 8000  # bytes/s
    since = time.monotonic() + 1.0
    wait_for(lambda: far.history().moves(since), 20.0, "a robot that is driven at 20 Hz over 64 kbit/s")
    far.proxy.upstream.rate = 2000  # less than the driver sends, so that its commands wait longer and longer
    since = time.monotonic()
    wait_for(lambda: any(not row.moves for row in far.history().odom if row.begin > since), 30.0, "a link that is full")
    assert far.driver.returncode is None
    far.driver.kill()
    far.wait_for_odom(time.monotonic() + 2)
    far.history().check_silence()
    assert not far.history().odom[-1].moves


def test_commands_that_a_relay_reorders_never_go_back(wire: Wire) -> None:
    """It holds some back and sends them on in another order, each with the stamp of its sender.

    A speed tells the number of its command. Until a robot has settled, the engine's contacts add some 1e-9 m/s to what
    is commanded; from then on odom has the command itself.
    """
    wire.start("sim").wait_for_line("listens on cmd_vel")
    assert wire.run(*EACH_STEP).returncode == 0
    bus, relay = wire.bus("driver"), wire.bus("relay")
    commands, waiting = bus.publisher("relayed", Twist), relay.subscribe_raw("relayed")
    odom, status = bus.subscribe("odom", Odometry, depth=10_000), bus.latest("cmd_vel_status", CommandStatus)
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
            relay.session.put("cmd_vel", sample.payload, encoding=sample.encoding, attachment=sample.attachment)
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
