"""`holozen xacro` prints what the library expands."""

import subprocess
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path

import pytest

from holozen import data
from holozen.robot.files.xacro import expand_xacro
from holozen.testing.wire import command

from .conftest import Verb
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
