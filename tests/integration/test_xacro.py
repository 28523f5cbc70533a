"""`holozen xacro` prints what the library expands."""

import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from holozen import data
from holozen.robot.files.xacro import expand_xacro
from holozen.testing.process import run
from holozen.testing.wire import command

from .conftest import Verb
from .processes import assert_one_line

BOT = data.find("urdf", "hb_bot.urdf.xacro")


def test_it_prints_the_text_of_the_library() -> None:
    done = run(command("xacro", str(BOT)))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == expand_xacro(BOT)
    assert len(ET.fromstring(done.stdout).findall("joint")) == 4


def test_it_takes_packages_and_refuses_what_is_no_argument(call: Verb, tmp_path: Path) -> None:
    (tmp_path / "finds.xacro").write_text('<robot name="$(find mine)"/>')
    found = call("xacro", str(tmp_path / "finds.xacro"), "--package", f"mine={tmp_path}")
    assert str(tmp_path) in found.stdout, found.stderr
    assert_one_line(call("xacro", str(BOT), "n=7"), 2, "'n=7': write n:=7")


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
