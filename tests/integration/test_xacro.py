"""`holozen xacro` prints what the library expands, and with --watch does so on every save."""

import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from holozen import data
from holozen.robot.xacro import expand_xacro
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command

from .conftest import Verb, start_sim
from .processes import assert_one_line

BOT = data.find("urdf", "hb_bot.urdf.xacro")
ASKS = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="n" default="1"/><link name="l$(arg n)"/></robot>"""


@pytest.fixture
def xacro(call: Verb) -> Verb:
    return partial(call, "xacro")


def test_it_prints_the_text_of_the_library() -> None:
    done = subprocess.run(command("xacro", str(BOT)), capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == expand_xacro(BOT)
    assert len(ET.fromstring(done.stdout).findall("joint")) == 4


def test_it_writes_to_a_file(xacro: Verb, tmp_path: Path) -> None:
    done = xacro(str(BOT), "-o", str(tmp_path / "bot.urdf"))
    assert (done.returncode, done.stdout) == (0, "")
    assert (tmp_path / "bot.urdf").read_text() == expand_xacro(BOT)


def test_it_takes_arguments_and_packages(xacro: Verb, tmp_path: Path) -> None:
    (tmp_path / "asks.xacro").write_text(ASKS)
    assert '<link name="l1"/>' in xacro(str(tmp_path / "asks.xacro")).stdout
    assert '<link name="l7"/>' in xacro(str(tmp_path / "asks.xacro"), "n:=7").stdout
    (tmp_path / "finds.xacro").write_text('<robot name="$(find mine)"/>')
    found = xacro(str(tmp_path / "finds.xacro"), "--package", f"mine={tmp_path}")
    assert str(tmp_path) in found.stdout, found.stderr


@pytest.mark.parametrize(
    ("content", "words", "code", "reason"),
    [
        (None, [], 1, "robot.xacro"),
        ('<robot name="r">${1/0}</robot>', [], 1, "division by zero"),
        ("<robot/>", ["n=7"], 2, "'n=7': write n:=7"),
        ("<robot/>", ["-o", "/nowhere/robot.urdf"], 1, "/nowhere/robot.urdf"),
    ],
)
def test_an_error_is_reported_in_one_line(
    xacro: Verb, tmp_path: Path, content: str | None, words: list[str], code: int, reason: str
) -> None:
    if content is not None:
        (tmp_path / "robot.xacro").write_text(content)
    assert_one_line(xacro(str(tmp_path / "robot.xacro"), *words), code, reason)


@pytest.mark.parametrize(
    ("redirection", "expected"),
    [
        (">/dev/full", "cannot write to standard output: No space left on device"),
        (">&-", "there is no standard output; write to a file with -o OUT"),
    ],
)
def test_an_output_that_takes_nothing_is_one_line(redirection: str, expected: str) -> None:
    words = ["sh", "-c", f'"$@" {redirection}', "sh", *command("xacro", str(BOT))]
    done = subprocess.run(words, capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stderr) == (1, f"holozen xacro: {expected}\n")


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """hb_bot in a folder of its own, with its materials and meshes."""
    shutil.copytree(BOT.parent, tmp_path / "urdf")
    shutil.copytree(data.find("meshes"), tmp_path / "meshes")
    return tmp_path / "urdf" / BOT.name


@pytest.fixture
def watcher(robot: Path) -> Iterator[Process]:
    """Writes robot.urdf next to the robot on every save."""
    words = command("xacro", str(robot), "--watch", "-o", str(robot.with_name("robot.urdf")))
    with Process(words) as process:
        reported(process, 1)
        yield process


def reported(process: Process, count: int) -> str:
    """The newest of `count` lines that it has written."""
    wait_for(lambda: process.err.count("\n") >= count, what=lambda: f"line {count} of {process.err!r}")
    lines = process.err.splitlines()
    assert len(lines) == count, process.err
    return lines[-1].removeprefix("holozen xacro: ")


def test_every_save_is_one_line_and_a_new_text(robot: Path, watcher: Process) -> None:
    text, out = robot.read_text(), robot.with_name("robot.urdf")
    good = f"{robot} expanded, {out} written"
    assert (reported(watcher, 1), out.read_text()) == (good, expand_xacro(robot))
    robot.write_text(text.replace("</robot>", '<link name="saved"/></robot>'))
    assert (reported(watcher, 2), '"saved"' in out.read_text()) == (good, True)
    materials = robot.with_name("materials.xacro")
    materials.write_text(materials.read_text().replace("</robot>", '<link name="included"/></robot>'))
    assert (reported(watcher, 3), '"included"' in out.read_text()) == (good, True)
    (robot.parent / "new").write_text(text)
    (robot.parent / "new").rename(robot)  # as many an editor saves
    assert (reported(watcher, 4), '"saved"' in out.read_text()) == (good, False)


def test_an_argument_that_nothing_asks_for_is_a_warning_on_every_save(robot: Path) -> None:
    out = robot.with_name("robot.urdf")
    with Process(command("xacro", str(robot), "nmae:=Fred", "--watch", "-o", str(out))) as watcher:
        assert reported(watcher, 2) == f"{robot} expanded, {out} written"
        assert watcher.err.startswith(f"warning: {robot}: there is no argument 'nmae'")
        robot.write_text(robot.read_text().replace("</robot>", '<link name="saved"/></robot>'))
        reported(watcher, 4)


def test_an_error_is_one_line_and_cleared_by_the_next_good_save_until_ctrl_c(robot: Path, watcher: Process) -> None:
    text = robot.read_text()
    robot.write_text('<robot name="${1/0}"/>')
    assert "division by zero" in reported(watcher, 2)
    robot.write_text(text)
    assert reported(watcher, 3).startswith(f"{robot} expanded, ")
    robot.unlink()
    assert "No such file or directory" in reported(watcher, 4)
    robot.write_text(text)
    assert reported(watcher, 5).startswith(f"{robot} expanded, ")
    assert watcher.interrupt() == 0
    reported(watcher, 5)


def test_a_robot_is_respawned_in_a_running_sim_on_every_save(robot: Path) -> None:
    with Wire() as wire:
        sim = start_sim(wire)
        watcher = wire.start("xacro", str(robot), "--watch", "--name", "Fred", "-y", "2")
        expected = f"{robot} expanded, Fred listens on Fred/cmd_vel"
        assert reported(watcher, 1) == expected
        robot.write_text(robot.read_text().replace("0.28", "0.27"))
        assert reported(watcher, 2) == expected
        wait_for(
            lambda: sim.err.count("Fred was added to the world") + sim.out.count("Fred was added to the world") == 2
        )
        assert watcher.terminate() == 0


def test_without_a_sim_the_watcher_reports_that_and_goes_on(robot: Path) -> None:
    with Wire() as wire:
        watcher = wire.start("xacro", str(robot), "--watch")
        assert reported(watcher, 1).startswith(f"{robot} expanded, but no sim answered within ")
        assert watcher.terminate() == 0
