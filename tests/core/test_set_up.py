"""What scripts/venv uses and says on machines with other Pythons: programs that only say what they
were asked.
"""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
COMMANDS = ("bash", "cat", "cksum", "dirname", "env", "sed")  # all else that the script calls
PYTHON = """#!/bin/sh
case "$*" in
  *"(3, 11) <="*) test {minor} -ge 11 -a {minor} -le 14; exit ;;
  *ensurepip*) {venv}; exit ;;
  *-venv*) echo python3.{minor}-venv; exit ;;
  --version) echo "Python 3.{minor}.1"; exit ;;
esac
echo "made by 3.{minor}: $* ($0)" >&2; exit 1
"""
UV = '#!/bin/sh\necho "made by uv: $*" >&2; exit 1\n'
SetUp = Callable[..., str]


@pytest.fixture
def set_up(tmp_path: Path) -> SetUp:
    """`set_up(system, {name: minor version}, uv, shims)`: the last line of a set-up there, which
    ends after the choice. `shims` are Pythons of pyenv, before the others in PATH.

    A Python with a version below zero has no ensurepip.
    """

    def run(
        system: str, pythons: dict[str, int], uv: bool = False, shims: dict[str, int] = {}
    ) -> str:
        tree, path, of_pyenv = tmp_path / "tree", tmp_path / "bin", tmp_path / "pyenv" / "shims"
        for folder in (tree / "scripts", path, of_pyenv):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        for name in ("scripts/venv", "pyproject.toml", "requirements.lock"):
            shutil.copy(REPO / name, tree / name)
        for command in COMMANDS:
            found = shutil.which(command)
            assert found
            (path / command).symlink_to(found)
        programs = {"uname": f"#!/bin/sh\necho {system}\n"} | ({"uv": UV} if uv else {})
        files = {path / name: text for name, text in programs.items()}
        for folder, there in ((path, pythons), (of_pyenv, shims)):
            for name, minor in there.items():
                files[folder / name] = PYTHON.format(
                    minor=abs(minor), venv="true" if minor > 0 else "false"
                )
        for file, text in files.items():
            file.write_text(text)
            file.chmod(0o755)
        env = {"PATH": f"{of_pyenv}:{path}", "TMPDIR": os.environ.get("TMPDIR", "/tmp")}
        done = subprocess.run(
            [path / "bash", tree / "scripts" / "venv"], env=env, capture_output=True, text=True
        )
        assert done.returncode == 1, done.stderr
        return done.stderr.splitlines()[-1]

    return run


PC, PI, MAC = "Linux x86_64", "Linux aarch64", "Darwin arm64"
ALL = {"python3": 12, "python3.11": 11, "python3.12": 12, "python3.13": 13, "python3.14": 14}


def test_it_takes_3_11_where_pybullet_has_a_wheel_and_the_newest_elsewhere(set_up: SetUp) -> None:
    assert set_up(PC, ALL).startswith("made by 3.11: -m venv")
    assert set_up(PI, ALL).startswith("made by 3.14: -m venv")
    assert set_up(MAC, {"python3": 12}).startswith("made by 3.12: -m venv")
    assert set_up(PC, {"python3": 10, "python3.13": 13}).startswith("made by 3.13: -m venv")


def test_of_one_version_it_takes_the_systems_before_that_of_pyenv(
    set_up: SetUp, tmp_path: Path
) -> None:
    pyenv = {"python3.11": 11, "python3.12": 12}
    system, shim = (f"({tmp_path}/{folder}/python3.11)" for folder in ("bin", "pyenv/shims"))
    assert set_up(PC, ALL, shims=pyenv).endswith(system)
    assert set_up(PC, {"python3": 12}, shims=pyenv).endswith(shim)
    assert set_up(PC, {"python3.11": -11}, shims=pyenv).endswith(shim)
    with_uv = set_up(PC, {"python3.11": -11}, uv=True, shims=pyenv)
    assert f"--python {tmp_path}/bin/python3.11 .venv" in with_uv


def test_with_uv_it_uses_that_and_lets_it_get_a_python_if_there_is_none(
    set_up: SetUp, tmp_path: Path
) -> None:
    with_uv = set_up(PC, {"python3.13": -13}, uv=True)
    assert f"--python {tmp_path}/bin/python3.13 .venv" in with_uv
    assert "--python 3.11 .venv" in set_up(PC, {"python3": 10}, uv=True)
    assert "--python 3.14 .venv" in set_up(MAC, {}, uv=True)


def test_otherwise_one_line_says_what_to_install(set_up: SetUp) -> None:
    needs = "holozen: it needs Python 3.11, 3.12, 3.13 or 3.14, and there is {}; "
    needs += "install one of those, or uv, which gets one"
    assert set_up(PC, {"python3": 10}) == needs.format("Python 3.10.1")
    assert set_up(PI, {}) == needs.format("no Python")
    venv = (
        "holozen: python3.13 cannot make a .venv; on Debian and Ubuntu: sudo apt install "
        "python3.13-venv"
    )
    assert set_up(PI, {"python3": -13, "python3.13": -13}) == venv
