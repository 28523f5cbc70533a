"""What `holozen new` writes works at once, and what is there is never touched."""

import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from holozen.testing import LockStep
from holozen.testing.wire import command

from .conftest import Verb


@pytest.fixture
def run(tmp_path: Path) -> Verb:
    """Run a command in an empty folder."""
    return lambda *words: subprocess.run(
        words, cwd=tmp_path, capture_output=True, text=True, timeout=60
    )


@pytest.fixture
def new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Verb) -> Verb:
    """Run `holozen new WORDS...` there, in this process."""
    monkeypatch.chdir(tmp_path)
    return partial(call, "new")


def test_a_new_robot_passes_check_and_drives_on_its_body_or_its_wheels(
    new: Verb, call: Verb, tmp_path: Path, lock_step: Callable[..., LockStep]
) -> None:
    written = new("robot", "rosie", "--radius", "0.3", "--mass", "5")
    assert written.stdout.splitlines()[0] == "rosie.urdf.xacro"
    file = str(tmp_path / "rosie.urdf.xacro")
    checked = call("check", file)
    assert checked.stdout == "ok: 4 links, 3 wheels, planar_move on cmd_vel\n"
    for flags in ((), ("--drive", "omni")):
        sim = lock_step("--robot", file, *flags)
        for _ in range(5):
            sim.drive(y=0.3)
            sim.step(48)
        x, y, _ = sim.odom.pose.pose.planar()
        assert abs(x) < 0.02 and abs(y - 0.3) < 0.03
        sim.process.close()
        sim.bus.close()


def test_a_new_controller_passes_the_test_that_comes_with_it(run: Verb) -> None:
    assert run(*command("new", "controller", "go_there")).returncode == 0
    done = run(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    assert "1 passed" in done.stdout, done.stdout + done.stderr


def test_a_new_package_has_a_message_and_a_service(new: Verb, run: Verb) -> None:
    assert new("package", "our_msgs").returncode == 0
    for name, field in (
        ("our_msgs/msg/Battery", "float32 voltage"),
        ("our_msgs/srv/NextGoal", "int32 request_goal"),
    ):
        assert field in run(*command("interface", "show", name)).stdout


def test_what_is_there_is_left_as_it_is(new: Verb, tmp_path: Path) -> None:
    (tmp_path / "test_mine.py").write_text("mine")
    done = new("controller", "mine")
    assert done.returncode == 1 and "test_mine.py exists already" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["test_mine.py"]
    assert (tmp_path / "test_mine.py").read_text() == "mine"


@pytest.mark.parametrize("thing", ["controller", "package"])
def test_a_name_that_python_could_not_use_is_refused(new: Verb, tmp_path: Path, thing: str) -> None:
    for name in ("class", "holozen", "numpy", "math"):
        done = new(thing, name)
        assert (
            done.returncode == 2 and f"'{name}'" in done.stderr and "choose another" in done.stderr
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.needs("prlimit")
def test_a_write_that_fails_leaves_nothing_in_the_way(run: Verb, tmp_path: Path) -> None:
    words = command("new", "controller", "go_there")
    done = run("prlimit", "--fsize=100", *words)
    assert (done.returncode, done.stderr) == (
        1,
        "holozen new controller: go_there.py: File too large\n",
    )
    assert list(tmp_path.iterdir()) == []
    assert run(*words).returncode == 0


def test_nothing_is_written_where_a_part_is_in_the_way(new: Verb, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "srv").write_text("mine")
    (tmp_path / "far.py").symlink_to("nowhere")
    for words, place in ((("package", "mine"), "mine/srv"), (("controller", "far"), "far.py")):
        done = new(*words)
        assert done.returncode == 1 and f"{place} exists already" in done.stderr
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["far.py", "mine", "srv"]
