"""A fresh clone on a newer Python of this machine, set up by uv: there is no pybullet, and all else
runs.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.checkout import copy
from tests.elsewhere import chosen

NEWER = (14, 13, 12)  # minor versions of Python 3
CODE = "import sys, ensurepip; print(sys.version_info[1])"


def newer_pythons() -> Iterator[str]:
    """The Pythons of this machine that are newer than this one and have no pybullet, the newest
    first.
    """
    for minor in NEWER:
        names = [
            shutil.which(f"python3.{minor}"),
            *Path.home().glob(f".pyenv/versions/3.{minor}.*/bin/python3"),
        ]
        for name in map(str, filter(None, names)):
            done = subprocess.run([name, "-c", CODE], capture_output=True, text=True)
            if done.stdout.strip() == str(minor) and minor > sys.version_info[1]:
                yield name
                break


@pytest.mark.timeout(600)
def test_the_first_minutes_on_a_newer_python(
    tmp_path: Path, trials: Callable[[int, int], int]
) -> None:
    if not trials(0, 1):
        pytest.skip("not built: scripts/test --long sets up a clone on a newer Python")
    found = next(newer_pythons(), None)
    if not found:
        pytest.skip("not built: there is no Python from 3.12 to 3.14")
    tree, programs = copy(tmp_path / "holozen"), tmp_path / "programs"
    programs.mkdir()
    (programs / "uv").symlink_to(Path(sys.executable).with_name("uv"))
    env = os.environ | {"PATH": f"{programs}:{os.environ['PATH']}", "CI": "false"}

    def run(*words: str) -> str:
        done = subprocess.run(words, cwd=tree, env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run("uv", "venv", "--quiet", "--python", found, ".venv")
    run("scripts/venv", "requirements-dev.lock")
    assert "since pybullet has no wheel for Python 3." in run(".venv/bin/holozen", "doctor")
    run(".venv/bin/python", "-m", "pytest", "-q", "-p", "no:cacheprovider", *chosen())
