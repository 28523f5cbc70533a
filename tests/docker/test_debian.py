"""A fresh clone in a container of Debian 13 with Python 3.13, set up by pip: what README's first
command does, and the tests of the core with MuJoCo; with --long all tests but those of Docker.
"""

import io
import os
import subprocess
import tarfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.checkout import copy
from tests.elsewhere import chosen

from .stack import ROOT, docker

BASE = ROOT.parent / "shared" / "base-image"
NAME = "python:3.13-slim-trixie"
TREE = "/srv/holozen"
LONG = os.environ.get("HOLOZEN_LONG") == "1"
PARTS = "apt-get update -qq && apt-get install -qq -y git >/dev/null && CI=true scripts/parts"
Run = Callable[..., str]

pytestmark = [
    pytest.mark.skipif(
        not LONG and os.environ.get("CI") != "true",
        reason="not built: CI and scripts/test --long make and try a Debian with Python 3.13",
    ),
    pytest.mark.timeout(3600),
]


@pytest.fixture(scope="module")
def run(engine: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """`run(WORDS...)`: their output, in a container with a fresh clone; they have to succeed."""
    if BASE.exists():
        subprocess.run([BASE, "3.13"], check=True, capture_output=True)
    # File systems of the kernel: an overlay in user space may list a new file late.
    disks = ("--volume", str(Path(TREE).parent), "--tmpfs", "/tmp:exec")
    rights = ["--cap-add", "SYS_ADMIN"] if LONG else []  # some tests mount file systems
    container = docker(
        "run", "--detach", "--rm", "--init", *disks, *rights, NAME, "sleep", "infinity"
    ).strip()
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w") as tar:
        tar.add(copy(tmp_path_factory.mktemp("clone")), arcname=TREE)
    subprocess.run(["docker", "cp", "-", f"{container}:/"], input=archive.getvalue(), check=True)

    def run(*words: str) -> str:
        words = ("docker", "exec", "--workdir", TREE, container, *words)
        done = subprocess.run(words, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    yield run
    docker("rm", "--force", "--volumes", container)


def test_the_first_minutes_in_debian_13(run: Run) -> None:
    up = (
        "scripts/up >/tmp/up 2>&1 & for _ in $(seq 3000); do grep -q 'listens on' /tmp/up && "
        "break; sleep 0.2; done"
    )
    shown = run(
        "bash", "-c", f"{up}; .venv/bin/holozen topic echo odom --once; kill %1; wait; cat /tmp/up"
    )
    assert (
        "sim: the engine is mujoco, since pybullet has no wheel for Python 3.13 on Linux" in shown
    )
    assert (
        "child_frame_id: " in shown
        and "controller: continues" in shown
        and "Traceback" not in shown
    )
    run("scripts/venv", "requirements-dev.lock")
    run(".venv/bin/python", "-m", "pytest", "-q", "-p", "no:cacheprovider", *chosen())


def test_the_tests_pass_in_debian_13(run: Run) -> None:
    run("scripts/venv", "requirements-dev.lock")
    paths = ["tests/core"]
    if LONG:
        run("bash", "-c", PARTS)
        run("bash", "-c", "git init -q && git add -A")
        paths = ["tests", "--ignore=tests/docker"]
    words = ("-q", "-p", "no:cacheprovider", "--dist=loadfile", "--no-loadscope-reorder")
    cores = os.cpu_count() or 2
    many = f"--numprocesses={5 * cores // 2}"  # as scripts/test
    tests = (".venv/bin/python", "-m", "pytest", *words)
    run(*tests, "--collect-only", *paths)  # makes the byte code of all tests once
    run(*tests, many, "-m", "not alone", *paths)
    if LONG:
        few = f"--numprocesses={cores}"
        run(*tests, few, "-m", "alone", *paths)
