"""The wheel in clean environments: everything is in it, under one name, and each verb runs or
reports why not.

Nothing is downloaded: what the lock file already brought is lent to the new environments by path.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from email import message_from_bytes
from importlib.metadata import distribution, version
from pathlib import Path
from typing import Any

import pytest

from holozen.cli import VERBS
from holozen.engines import choose
from holozen.messages import Odometry
from holozen.testing import Process, Terminal, Wire, wait_for
from tests.checkout import copy

REPO = Path(__file__).parents[2]
NEEDED = ("eclipse-zenoh", "msgspec", "prompt-toolkit")
THEIRS = ("wcwidth",)  # what those need themselves
CLEAN = {"PYTHONPATH": ""}


def run(*words: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **CLEAN}
    return subprocess.run(
        list(map(str, words)), capture_output=True, text=True, timeout=120, env=env, cwd=cwd
    )


def good(*words: str | Path, cwd: Path | None = None) -> str:
    done = run(*words, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the source distribution, built from a copy of what the repo holds."""
    source, dist = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    copy(source)
    good(sys.executable, "-m", "build", "--no-isolation", "--outdir", dist, source)
    (sdist,) = dist.glob("*.tar.gz")
    assert sdist.stat().st_size < 2_000_000
    (wheel,) = dist.glob("*.whl")
    return wheel


def environment(folder: Path, wheel: Path, lent: Path) -> Path:
    """A new environment with the wheel in it, and the libraries in the folder `lent`."""
    good(sys.executable, "-m", "venv", "--without-pip", folder)
    (packages,) = folder.glob("lib/python*/site-packages")
    before = set(os.listdir(packages))
    good(
        sys.executable,
        "-m",
        "pip",
        "--python",
        folder,
        "install",
        "--no-deps",
        "--no-index",
        "--quiet",
        wheel,
    )
    assert {
        name for name in set(os.listdir(packages)) - before if not name.endswith(".dist-info")
    } == {"holozen"}
    (packages / "lent.pth").write_text(f"{lent}\n")
    return folder


@pytest.fixture(scope="module")
def full(bare: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with every extra: a copy of the bare one, which takes less than to install the
    wheel again.
    """
    folder = tmp_path_factory.mktemp("full") / "venv"
    shutil.copytree(bare, folder, symlinks=True)
    script = holozen(folder)
    script.write_text(script.read_text().replace(str(bare), str(folder)))
    (lent,) = folder.glob("lib/python*/site-packages/lent.pth")
    lent.write_text(f"{sysconfig.get_path('purelib')}\n")
    return folder


@pytest.fixture(scope="module")
def bare(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with what holozen needs without any extra."""
    lent = tmp_path_factory.mktemp("lent")
    for name in (*NEEDED, *THEIRS):
        files = distribution(name).files or []
        for top in {file.parts[0] for file in files if file.parts[0] not in ("..", "__pycache__")}:
            (lent / top).symlink_to(Path(str(distribution(name).locate_file(top))))
    return environment(tmp_path_factory.mktemp("bare") / "venv", wheel, lent)


def holozen(environment: Path) -> Path:
    return environment / "bin" / "holozen"


def answer(environment: Path, code: str) -> Any:
    return json.loads(
        good(environment / "bin" / "python", "-I", "-c", f"import json\n{code}", cwd=environment)
    )


def test_the_wheel_declares_what_is_needed_without_any_extra(wheel: Path) -> None:
    (name,) = [
        name for name in zipfile.ZipFile(wheel).namelist() if name.endswith(".dist-info/METADATA")
    ]
    metadata = message_from_bytes(zipfile.ZipFile(wheel).read(name))
    declared = [line for line in metadata.get_all("Requires-Dist", []) if "extra ==" not in line]
    assert sorted(re.split("[<>=!~ ]", line)[0] for line in declared) == sorted(NEEDED)


def test_the_wheel_holds_one_package_and_nothing_of_the_tests(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.partition("/")[0] for name in names if ".dist-info" not in name} == {"holozen"}
    assert not [name for name in names if name.endswith((".pyc", ".orig")) or "tests" in name]


def test_every_file_of_the_library_and_the_services_is_in_the_wheel(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for top, there in (
        ("holozen", "holozen"),
        ("services", "holozen"),
        *EXTENSIONS,
        *((d, f"holozen/{d}") for d in DATA),
    ):
        files = [
            path
            for path in (REPO / top).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        ]
        assert {f"{there}/{path.relative_to(REPO / top).as_posix()}" for path in files} <= names


DATA = ("meshes", "urdf", "worlds")
EXTENSIONS = [
    (f"extensions/{path.parent.name}", f"holozen/{path.parent.name}")
    for path in REPO.glob("extensions/*/__init__.py")
]


def test_there_is_no_package_called_services(full: Path) -> None:
    code = (
        "from importlib.util import find_spec as f; print(json.dumps([f('services') is None, "
        "f('holozen.sim').origin]))"
    )
    none, origin = answer(full, code)
    assert none is True
    assert origin.startswith(str(full))


def test_it_is_typed(full: Path) -> None:
    (package,) = full.glob("lib/python*/site-packages/holozen")
    assert (package / "py.typed").exists()


def test_help_and_version_work_without_any_extra(bare: Path) -> None:
    assert "usage: holozen VERB" in good(holozen(bare), "--help")
    assert good(holozen(bare), "--version") == f"{version('holozen')}\n"


HELP = """
import contextlib, io
from holozen.cli import VERBS, main
helps = {}
for verb in VERBS:
    with contextlib.redirect_stdout(io.StringIO()) as shown, contextlib.suppress(SystemExit):
        main([verb, "--help"])
    helps[verb] = shown.getvalue()
print(json.dumps(helps))
"""


def test_every_verb_has_help_without_any_extra(bare: Path) -> None:
    helps = answer(bare, HELP)
    assert set(helps) == set(VERBS)
    assert [
        verb
        for verb, shown in helps.items()
        if f"usage: holozen {verb}" not in shown and verb != "xacro"
    ] == []


def test_data_files_are_found_inside_the_package(full: Path) -> None:
    names = [("urdf", "hb_bot.urdf.xacro"), ("meshes", "base.dae"), ("worlds", "gazebo.world")]
    found = f"[str(data.find(*name)) for name in {names}]"
    for path in map(Path, answer(full, f"from holozen import data; print(json.dumps({found}))")):
        assert path.is_file()
        assert full in path.parents


def test_the_robot_is_expanded_with_the_meshes_beside_it(full: Path) -> None:
    (robot,) = full.glob("lib/python*/site-packages/holozen/urdf/hb_bot.urdf.xacro")
    text = good(holozen(full), "xacro", robot)
    assert f"{robot.parents[1]}/meshes/wheel.stl" in text


def test_the_sim_starts_from_the_wheel_and_publishes_odom(full: Path, wire: Wire) -> None:
    odom = wire.bus().latest("odom", Odometry)
    with Process([str(holozen(full)), "sim", *wire.flags], env=CLEAN) as sim:
        wait_for(lambda: odom.count > 3, what=lambda: sim.err)
        assert sim.terminate() == 0
        # A busy machine is told of its slowness, and for whom it waits.
        engine, listens, *_ = [one for one in sim.err.splitlines() if one.startswith("sim: ")]
        assert engine == f"sim: the engine is {choose()}"
        assert listens == "sim: hb_bot listens on cmd_vel"


SCRIPT = """
import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node

rclpy.init()
node = Node("listener")
node.create_subscription(Odometry, "odom", lambda odom: (print("heard", odom.child_frame_id), rclpy.shutdown()), 10)
rclpy.spin(node)
"""  # noqa: E501


def test_a_first_hour_with_the_wheel(full: Path, wire: Wire, tmp_path: Path) -> None:
    """up, view, new, check, run and record."""
    with Process([str(holozen(full)), "up", *wire.flags], env=CLEAN) as up:
        up.wait_for_line("4 goals from square", within=60)
        with Process([str(holozen(full)), "view", "--port", "0", *wire.flags], env=CLEAN) as view:
            view.wait_for_line("http://127.0.0.1:")
            assert view.terminate() == 0
        good(holozen(full), "new", "robot", "rosie", cwd=tmp_path)
        assert good(holozen(full), "check", "rosie.urdf.xacro", cwd=tmp_path).startswith(
            "ok: 4 links, 3 wheels"
        )
        (tmp_path / "listener.py").write_text(SCRIPT)
        assert "heard footprint_link" in good(
            holozen(full), "run", *wire.flags, "listener.py", cwd=tmp_path
        )
        words = [str(holozen(full)), "record", "odom", "-o", str(tmp_path / "drive"), "--json"]
        with Process([*words, *wire.flags], env=CLEAN) as recorder:
            wait_for(lambda: re.search(r'"messages": [1-9]', recorder.out), what="odom")
            assert recorder.interrupt() == 0
        assert "odom" in good(holozen(full), "bag", "info", "drive.mcap", cwd=tmp_path)
        assert up.interrupt() == 0


def test_templates_are_in_the_wheel(bare: Path, tmp_path: Path) -> None:
    good(holozen(bare), "new", "package", "ours", cwd=tmp_path)
    assert "float32 voltage" in good(
        holozen(bare), "interface", "show", "ours/msg/Battery", cwd=tmp_path
    )


def test_the_sim_without_its_extra_names_it(bare: Path, wire: Wire) -> None:
    done = run(holozen(bare), "sim", *wire.flags)
    assert (done.returncode, done.stdout) == (1, "")
    advice = r"in the checkout of holozen, run: uv pip install -e '\.\[sim\]'"  # there is no pip
    assert re.fullmatch(rf"holozen sim needs (numpy|xacro); {advice}\n", done.stderr)


def test_the_teleop_needs_no_extra(bare: Path, wire: Wire) -> None:
    with Terminal([str(holozen(bare)), "teleop", *wire.flags], env=CLEAN) as terminal:
        terminal.wait_for_text("NO ODOM")
        terminal.type("\x03")
        assert terminal.process.wait() == 0


def test_xacro_without_its_extra_names_what_to_install(bare: Path) -> None:
    (robot,) = bare.glob("lib/python*/site-packages/holozen/urdf/hb_bot.urdf.xacro")
    done = run(holozen(bare), "xacro", robot)
    assert (done.returncode, done.stdout) == (1, "")
    assert "pip install" in done.stderr
    assert done.stderr.count("\n") == 1


def test_what_needs_no_extra_runs_without_any(bare: Path, wire: Wire) -> None:
    with Process([str(holozen(bare)), "pose-service", *wire.flags], env=CLEAN) as service:
        service.wait_for_line("4 goals from square")
        words = ["service", "call", "next_goal", '{"request_goal": 3}', "--json", *wire.flags]
        reply = json.loads(good(holozen(bare), *words))
        assert service.terminate() == 0
    assert (reply["x_goal"], reply["end_of_list"]) == (0.0, 1)


def test_yaml_without_its_library_names_what_to_install(bare: Path, wire: Wire) -> None:
    done = run(holozen(bare), "topic", "pub", "cmd_vel", "linear: {x: 1}", *wire.flags)
    assert (done.returncode, done.stdout) == (1, "")
    assert "pip install pyyaml" in done.stderr
    assert done.stderr.count("\n") == 1


def test_pytest_finds_the_fixtures_by_the_entry_point(full: Path, tmp_path: Path) -> None:
    test = tmp_path / "test_mine.py"
    test.write_text(
        "def test_mine(wire, wait_for):\n    bus = wire.bus('me', lasting=True)\n    "
        "wait_for(bus.graph().endpoints)\n"
    )
    helps = good(
        full / "bin" / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider", test, cwd=tmp_path
    )
    assert "1 passed" in helps
