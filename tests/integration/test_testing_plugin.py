"""The fixtures that come with holozen, as other projects' tests use them."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from holozen.testing import wait_for

USERS_TESTS = """
from holozen.messages import Odometry, Twist

def test_the_robot_drives_and_stands_in_silence(wire, wait_for):
    wire.start("sim")
    bus = wire.bus("my_test")
    odom = bus.latest("odom", Odometry)
    commands = bus.publisher("cmd_vel", Twist)
    wait_for(lambda: odom.count)

    def drives():
        commands.put(Twist.planar(x=0.3))
        return odom.read()[0].twist.twist.linear.x > 0.2

    wait_for(drives)
    wait_for(lambda: abs(odom.read()[0].twist.twist.linear.x) < 0.01)

def test_a_key_drives(wire, terminal, wait_for):
    wire.start("sim").wait_for_line("listens on")
    teleop = terminal("teleop", "--speed", "0.2", "--mode", "latch")
    teleop.wait_for_text("listening sim")
    teleop.hold_until("i", lambda: "+0.200 m/s" in teleop.screen())  # measured
    assert teleop.process.terminate() == 0
    assert teleop.modes() == teleop.modes_before
"""
TWO_WIRES = """
from holozen.testing import Wire

def test_two_wires_hear_nothing_of_each_other(wire, wait_for):
    wire.start("sim", "--empty").wait_for_line("no robot yet")
    wait_for(lambda: "clock" in wire.run("topic", "list").stdout)
    with Wire() as other:
        assert other.run("topic", "list").stdout == ""
"""


def run_pytest(folder: Path, tests: str, *flags: str) -> subprocess.CompletedProcess[str]:
    (folder / "test_mine.py").write_text(tests)
    words = [
        sys.executable,
        "-W",
        "error",
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        "-W",
        "error",
        *flags,
        str(folder),
    ]
    return subprocess.run(words, capture_output=True, text=True, cwd=folder, timeout=120)


def running_at(text: str) -> list[str]:
    """The processes that run holozen and name this text."""
    shown = subprocess.run(
        ["ps", "-eo", "pid,args"], capture_output=True, text=True, check=True
    ).stdout
    return [line for line in shown.splitlines() if "-m holozen" in line and text in line]


def test_a_user_tests_a_robot_without_an_import_of_ours_each_test_on_a_wire_of_its_own(
    tmp_path: Path,
) -> None:
    done = run_pytest(tmp_path, USERS_TESTS + TWO_WIRES)
    assert done.returncode == 0, done.stdout
    assert "3 passed" in done.stdout


IN_VAIN = {
    "wait_for(lambda: [], within=0.1, what='rain')": "waited 0.1 s in vain for rain; the last "
    "look gave []",
    "wire.start('router').wait_for_line('tea', within=0.5)": "'tea' from <",
    "wire.start('sim', '--rtf', 'x').wait_for_line('tea')": "exit code 2> ended without 'tea'; it "
    "wrote:",
    "wire.start('router').wait(within=0.1)": "still runs after 0.1 s; it wrote:",
    "terminal('topic', 'list').wait_for_text('tea')": "ended without 'tea' on its screen:",
    "lock_step('--nonsense')": "no flag '--nonsense'",
    # a new Python: a forked one has loaded its engine, during which a sim learns of others
    "lock_step(); lock_step(is_new=True)": "simulates here already",
    "sim = lock_step(); sim.process.kill(); sim.step()": "exit code -9>; it wrote:",
    "sim = lock_step(); sim.process.kill(); sim.drive(x=0.3)": "exit code -9>; it wrote:",
}


HEAVY = ["zenoh", "msgspec", "numpy", "pybullet", "pyte"]
WITHOUT_FIXTURES = (
    f"import sys\ndef test_first():\n    assert not set({HEAVY}) & set(sys.modules)\n"
)
FAILS = """
def test_that_fails(wire):
    wire.start("router").wait_for_line("listens at")
    wire.terminal("teleop").wait_for_text("listening")
    print(f"ENDPOINT {wire.endpoint}.")
    assert False
"""
WITHOUT_PYTE = """
def test_without_pyte(terminal, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyte", None)
    terminal("topic", "list").screen()
"""


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What one run of pytest shows of a test that passes, and of many that fail."""
    vain = [
        f"def test_{n}(wire, terminal, wait_for, lock_step):\n    {test}\n"
        for n, test in enumerate(IN_VAIN)
    ]
    done = run_pytest(
        tmp_path_factory.mktemp("failing"),
        "\n".join([WITHOUT_FIXTURES, FAILS, *vain, WITHOUT_PYTE]),
    )
    assert done.returncode == 1
    return done.stdout


def test_pytest_loads_nothing_heavy_without_the_fixtures(shown: str) -> None:
    assert ", 1 passed" in shown, shown
    assert "_ test_first _" not in shown, "which is the one that looks"


@pytest.mark.needs("ps")
def test_a_test_that_fails_shows_what_its_processes_wrote_and_leaves_none(shown: str) -> None:
    _, _, of_it = shown.partition("_ test_that_fails _")
    of_it, _, _ = of_it.partition("_ test_0 _")
    assert "router: listens at" in of_it
    endpoint = re.search(r"ENDPOINT (tcp/127\.0\.0\.1:\d+)\.", of_it)
    assert endpoint
    assert running_at(endpoint[1]) == []


def test_a_condition_that_never_comes_true_names_what_was_awaited(shown: str) -> None:
    assert f"{len(IN_VAIN) + 2} failed" in shown, "and the two others"
    for test, reason in IN_VAIN.items():
        assert reason in shown, test
    assert "waited 60 s" not in shown


def test_without_pyte_the_screen_names_what_to_install(shown: str) -> None:
    assert "RuntimeError: Terminal.screen needs pyte; run: pip install pyte" in shown


def test_a_killed_test_leaves_no_process(tmp_path: Path) -> None:
    """As the workers of pytest-xdist are killed after Ctrl-C."""
    test = """
import os, pathlib, signal

def test_it(wire):
    router = wire.start("router")
    router.wait_for_line("listens at")
    pathlib.Path("pid").write_text(str(router.pid))
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert run_pytest(tmp_path, test).returncode == -signal.SIGKILL
    pid = (tmp_path / "pid").read_text()
    wait_for(lambda: not Path(f"/proc/{pid}").exists(), what="the end of the router")


LEAVES = """
from holozen.messages import Odometry

def test_it_flies(wire, wait_for):
    wire.start("sim").wait_for_line("listens on")
    odom = wire.bus().latest("odom", Odometry)
    wait_for(lambda: odom.count > 50)  # the recorder, which came first, has received some too
    assert odom.read()[0].pose.pose.position.z > 1, "it does not"

def test_it_stands(wire):
    wire.start("sim").wait_for_line("listens on")
"""


def test_a_failed_test_leaves_a_bag_a_picture_and_the_logs(tmp_path: Path) -> None:
    done = run_pytest(tmp_path, LEAVES, "--holozen-artifacts", "left", "--junit-xml", "junit.xml")
    assert "1 failed, 1 passed" in done.stdout
    assert "it does not" in (tmp_path / "junit.xml").read_text()
    (left,) = (tmp_path / "left").iterdir()
    assert left.name == "test_mine.py_test_it_flies"
    assert {path.name for path in left.iterdir()} == {
        "1-record.log",
        "2-sim.log",
        "bag.mcap",
        "paths.png",
        "picture.log",
    }
    assert "listens on cmd_vel" in (left / "2-sim.log").read_text()
    assert (left / "paths.png").read_bytes().startswith(b"\x89PNG")
    assert b"nav_msgs/msg/Odometry" in (left / "bag.mcap").read_bytes()
