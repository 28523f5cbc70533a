"""After a cut of the link no command that waited in it moves a robot, even if its sender has died.

Each side has a monotonic clock of its own. Cuts are links that are set down between network
namespaces.
"""

import os
import random
import signal
import sys
import time
from collections.abc import Iterator

import pytest

from holozen.testing import Process, wait_for
from holozen.testing.wire import command, free_port

from .history import CLOCK, EACH_STEP, STAMPS, History, script, wait_for_motion, wait_for_odom
from .namespaces import NEEDS, Cable, Host, Lab

pytestmark = NEEDS

LONG = os.environ.get("HOLOZEN_LONG") == "1"
TRIALS = 34 if LONG else 1  # of each cut and fate, so some hundred of each cut
CUTS = (0.2, 0.6, 0.9, 2.0)  # s
# Those of a short run, by what happens to the driver meanwhile.
SHORT_CUTS = {"alive": (0.6, 2.0), "killed": (0.6,), "stopped": (2.0,)}
LONG_CUTS = (15.0, 60.0) if LONG else ()  # s, once each


class Course:
    """A sim on one host, its drivers on another, and what was seen of both."""

    def __init__(self, lab: Lab) -> None:
        self.robot: Host = lab.host("robot")
        self.desk: Host = lab.host("desk", clock=CLOCK)
        self.cable: Cable = lab.cable(self.robot, self.desk)
        port = free_port()
        at = f"tcp/{self.cable.address(self.robot)}:{port}"
        self.endpoint, here = at, f"tcp/127.0.0.1:{port}"
        words = command("sim", "--listen", f"tcp/0.0.0.0:{port}", "--connect", here, *STAMPS)
        self.robot.start(*words).wait_for_line("listens on cmd_vel")
        self.robot.check(*command(*EACH_STEP, "--connect", here))
        self.observer = self.robot.start(*script("observer", here))
        self.drivers: list[Process] = []

    def drive(self) -> Process:
        """Start a driver, and wait until the robot moves."""
        began = time.monotonic()
        driver = self.desk.start(*script("driver", self.endpoint))
        self.drivers.append(driver)
        wait_for_motion(self.observer, began)
        return driver

    def history(self) -> History:
        return History.of(self.drivers, self.observer, CLOCK)


@pytest.fixture(scope="module")
def only_course() -> Iterator[Course]:
    with Lab() as lab:
        yield Course(lab)


@pytest.fixture
def course(only_course: Course) -> Course:
    """The file's course, with a history of the test's own."""
    if only_course.drivers:
        only_course.drivers, only_course.observer = [], restart(only_course)
    return only_course


@pytest.mark.timeout(60 + 15 * TRIALS * len(CUTS) + 2 * sum(LONG_CUTS))
@pytest.mark.parametrize("fate", SHORT_CUTS)
def test_after_a_cut_nothing_that_waited_moves_the_robot(course: Course, fate: str) -> None:
    longest = away = 0.0
    for cut in (*CUTS * TRIALS, *LONG_CUTS) if LONG else SHORT_CUTS[fate]:
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
            wait_for_motion(course.observer, restored)
            away = max(away, course.history().moves(restored)[0].begin - restored)
        wait_for_odom(course.observer, restored + 1.0)
        resumed = time.monotonic()
        driver.signal(signal.SIGCONT)
        driver.close()
        history = course.history()
        if cut > 0.5:
            assert not history.moves(began + 0.55, restored), "the cut did not hit"
        history.check_silence(began)
        history.check_restored(restored, resumed)
        longest = max(longest, history.longest(began))
    print(f"{fate}: moved on for at most {longest:.3f} s after the last command was sent")
    print(f"{fate}: driven again at most {away:.3f} s after the link came back")


@pytest.mark.needs("nft")
@pytest.mark.parametrize("fate", ["alive", "killed"])
def test_after_a_cut_that_neither_end_sees_nothing_moves_the_robot_either(
    course: Course, fate: str
) -> None:
    """Packets are dropped both ways: links stay half-open, and no end of a process comes
    through.
    """
    driver = course.drive()
    course.cable.lose(1.0)
    began = time.monotonic()
    time.sleep(0.58)  # TCP sends what waits again 0.2, 0.6 and 1.4 s later
    if fate == "killed":
        driver.kill()
    restored = time.monotonic()
    course.cable.lose(0.0)
    if fate == "alive":
        wait_for_motion(course.observer, restored)
    wait_for_odom(course.observer, restored + 1.5)
    driver.close()
    history = course.history()
    assert not history.moves(began + 0.55, restored), "the cut did not hit"
    history.check_silence(began)
    history.check_restored(restored)


@pytest.mark.needs("nft")
def test_where_a_third_of_the_packets_is_lost_nothing_old_moves_the_robot(course: Course) -> None:
    driver = course.drive()
    began, before = time.monotonic(), sent_again(course.desk)
    course.cable.lose(0.3)
    wait_for(
        lambda: sent_again(course.desk) > before + 5, 30.0, "packets that were lost and sent again"
    )
    driver.kill()
    course.cable.lose(0.0)
    wait_for_odom(course.observer, time.monotonic() + 1.0)
    history = course.history()
    history.check_silence(began)
    assert not history.odom[-1].moves


def sent_again(host: Host) -> int:
    """How many TCP segments a host has retransmitted."""
    names, values = (line.split() for line in host.proc_net("snmp") if line.startswith("Tcp:"))
    return int(values[names.index("RetransSegs")])


def restart(course: Course) -> Process:
    """Start another observer, so that a history stays short."""
    course.observer.close()
    words = course.observer.words
    return course.robot.start(*words[words.index(sys.executable) :])
