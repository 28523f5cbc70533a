"""Commands are as old as their sending: none that waited on the way moves a robot, also when its sender has died.

Each side has a monotonic clock of its own. Cuts are links that are set down between network namespaces, delays are
those of a proxy.
"""

import os
import random
import signal
import sys
import time
from collections.abc import Iterator

import pytest

from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command, free_port

from .history import CLOCK, EACH_STEP, History, newest, script
from .namespaces import NEEDS, Cable, Host, Lab
from .proxy import Proxy

pytestmark = NEEDS

TRIALS = 34 if os.environ.get("HOLOZEN_LONG") else 1  # of each cut and fate, so some hundred of each cut
CUTS = (0.2, 0.6, 0.9, 2.0)  # s
DELAYS = [(0.1, True), (0.4, True), (0.6, False), (2.0, False), (0.1, True)]
"""Delays of a link in s, one way, one after another; and whether the robot is driven over it."""
if os.environ.get("HOLOZEN_LONG"):
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


@pytest.mark.timeout(60 + 15 * TRIALS * len(CUTS))
@pytest.mark.parametrize("fate", ["alive", "killed", "stopped"])
def test_after_a_cut_nothing_that_waited_moves_the_robot(course: Course, fate: str) -> None:
    longest = 0.0
    for trial in range(TRIALS * len(CUTS)):
        cut = CUTS[trial % len(CUTS)]
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
    """How many segments of TCP a host has sent again."""
    names, values = (line.split() for line in host.proc_net("snmp") if line.startswith("Tcp:"))
    return int(values[names.index("RetransSegs")])


def restart(course: Course) -> Process:
    """Another observer, so that a history stays short."""
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

    def wait_for_odom(self, at: float) -> None:
        wait_for(lambda: newest(self.observer) > at, 20.0, "odom")


@pytest.fixture
def far(wire: Wire, proxy: Proxy, lab: Lab) -> Iterator[Far]:
    far = Far(wire, proxy, lab)
    with far.observer, far.driver:
        wait_for(lambda: far.history().moves(0.0), 20.0, "a robot that moves")
        yield far


def test_a_link_that_becomes_slow_stops_the_robot_and_a_late_stop_is_obeyed(far: Far) -> None:
    for delay, drives in DELAYS:
        far.proxy.set(delay=delay)
        begin = time.monotonic() + 2 * delay + 1.5
        far.wait_for_odom(begin + 1)
        history = far.history()
        assert bool(history.moves(begin, begin + 1)) == drives, f"with a delay of {delay} s"
        history.check_silence()
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
    since = time.monotonic()
    wait_for(lambda: far.history().moves(since), 20.0, "a robot that moves")


def test_a_link_that_jitters_moves_the_robot_only_by_what_is_fresh(far: Far) -> None:
    far.proxy.set(delay=0.1, jitter=0.4)
    far.wait_for_odom(time.monotonic() + 5)
    far.driver.kill()
    far.wait_for_odom(time.monotonic() + 2)
    far.history().check_silence()
