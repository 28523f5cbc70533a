"""The commands of the README do what it promises, as they stand there."""

import contextlib
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Process, Terminal, Wire, wait_for

REPO = Path(__file__).parents[2]
# What those that last print, with which they have begun; they end by Ctrl-C.
LASTING = {
    "topic echo": "pose:",
    "topic pub": "subscriber of cmd_vel",
    "view": "http://127.0.0.1:",
    "teleop": "listening sim",
    "launch": "goal 1",
}


def commands(section: str) -> list[str]:
    """The holozen commands in the code blocks of a section."""
    text = (REPO / "README.md").read_text().partition(f"## {section}\n")[2].partition("\n## ")[0]
    lines = [
        line
        for block in re.findall(r"^```\n(.*?)^```", text, re.M | re.S)
        for line in block.splitlines()
    ]
    found = [line.partition(" #")[0].strip() for line in lines if line.startswith("holozen ")]
    assert found, section
    return found


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wire: Wire) -> Iterator[Path]:
    """The working folder: a checkout. Processes meet on the wire of the test."""
    for name in ("examples", "urdf", "meshes", "worlds"):
        (tmp_path / name).symlink_to(REPO / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOLOZEN_CONNECT", wire.endpoint)
    monkeypatch.setenv("HOLOZEN_LISTEN", wire.endpoint)
    yield tmp_path


@contextlib.contextmanager
def begun(line: str) -> Iterator[Process | Terminal]:
    """A command that lasts, and has begun."""
    words = [sys.executable, "-m", *shlex.split(line)]
    text = next(text for start, text in LASTING.items() if line.startswith(f"holozen {start}"))
    if line.startswith("holozen teleop"):
        with Terminal(words) as terminal:
            terminal.wait_for_text(text)
            yield terminal
        return
    with Process(words) as process:
        process.wait_for_line(text, within=40)
        yield process


def ends(line: str) -> None:
    """Run a command to its end."""
    with Process([sys.executable, "-m", *shlex.split(line)]) as process:
        # on a busy machine doctor finds that something is slow
        codes = (0, 1) if line.startswith("holozen doctor") else (0,)
        assert process.wait(40) in codes, f"{line}: {process.out}{process.err}"
        assert "Traceback" not in process.err, line


def runs(line: str) -> None:
    """Run a command to its end, or until it has begun and Ctrl-C ends it."""
    if not any(line.startswith(f"holozen {start}") for start in LASTING):
        return ends(line)
    with begun(line) as started:
        if isinstance(started, Terminal):
            started.type("\x03")
            assert started.process.wait() == 0, line
        else:
            assert started.interrupt() in (0, 130), f"{line}: {started.err}"
            assert "Traceback" not in started.err, line


@pytest.mark.usefixtures("folder")
def test_what_watches_a_robot_watches_it(wire: Wire) -> None:
    up = wire.start("up")
    up.wait_for_line("goals")
    wait_for(lambda: "controller" in wire.run("node", "list").stdout)
    for line in commands("Watch it"):
        runs(line)


@pytest.mark.usefixtures("folder")
def test_a_robot_of_ones_own_is_checked_spawned_and_driven(wire: Wire) -> None:
    wire.start("sim", "--empty").wait_for_line("no robot yet")
    for line in commands("Your own robot"):
        runs(line)


@pytest.mark.usefixtures("folder")
def test_a_launch_file_for_ros_runs() -> None:
    for line in commands("Scripts for ROS 2"):
        runs(line)
