"""`holozen xacro` prints what the library expands."""

import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from holozen import data
from holozen.robot.xacro import expand
from holozen.testing.wire import command

BOT = data.find("urdf", "hb_bot.urdf.xacro")
ASKS = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="n" default="1"/><link name="l$(arg n)"/></robot>"""


def xacro(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command("xacro", *words), capture_output=True, text=True, timeout=30)


def test_it_prints_the_text_of_the_library() -> None:
    done = xacro(str(BOT))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == expand(BOT)
    assert len(ET.fromstring(done.stdout).findall("joint")) == 4


def test_it_writes_to_a_file(tmp_path: Path) -> None:
    done = xacro(str(BOT), "-o", str(tmp_path / "bot.urdf"))
    assert (done.returncode, done.stdout) == (0, "")
    assert (tmp_path / "bot.urdf").read_text() == expand(BOT)


def test_it_takes_arguments_and_packages(tmp_path: Path) -> None:
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
        ("<robot", [], 1, "robot.xacro"),
        ('<robot name="r">${1/0}</robot>', [], 1, "division by zero"),
        ('<robot name="$(find nowhere)"/>', [], 1, "nowhere"),
        ("<robot/>", ["n=7"], 1, "'n=7': write name:=value"),
        ("<robot/>", ["--package", "holo"], 2, "'holo': write NAME=DIR"),
        ("<robot/>", ["-o", "/nowhere/robot.urdf"], 1, "/nowhere/robot.urdf"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(
    tmp_path: Path, content: str | None, words: list[str], code: int, reason: str
) -> None:
    if content is not None:
        (tmp_path / "robot.xacro").write_text(content)
    done = xacro(str(tmp_path / "robot.xacro"), *words)
    assert (done.returncode, done.stdout) == (code, "")
    said = [line for line in done.stderr.splitlines() if not line.startswith(("usage:", "   "))]
    assert len(said) == 1, done.stderr
    assert reason in said[0]
