"""Each extension can be deleted: the core builds and runs without it, and its verbs say what is
missing.
"""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from holozen.cli import table
from tests.checkout import copy
from tests.present import EXTENSIONS, VERBS

LONG = os.environ.get("HOLOZEN_LONG") == "1"
# What is left out together; each by itself in a long run.
GONE = [[name] for name in sorted(EXTENSIONS)] if LONG else [sorted(EXTENSIONS)]
EACH = """
import contextlib, io, json, sys
from holozen import cli
shown = {}
for words in json.loads(sys.argv[1]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = cli.main(words)
        except SystemExit as end:
            code = end.code
    shown[" ".join(words)] = [code, out.getvalue(), err.getvalue()]
print(json.dumps(shown))
"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tree."""
    return copy(tmp_path_factory.mktemp("tree"))


@pytest.fixture
def without(tree: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Callable[..., Path]:
    """`without("view")`: the copy, without an extension and its tests until the end of the test."""

    def delete(*names: str) -> Path:
        for name in names:
            for folder in (tree / "extensions" / name, tree / "tests" / "extensions" / name):
                kept = tmp_path / f"{folder.parent.parent.name}-{name}"
                shutil.move(folder, kept)
                request.addfinalizer(partial(shutil.move, kept, folder))
        return tree

    return delete


def run(tree: Path, *words: str, timeout: float = 120) -> subprocess.CompletedProcess[str]:
    """Run Python in a tree, so that `holozen` is that tree's; tests without their long trials."""
    env = {**os.environ, "PYTHONPATH": str(tree)}
    env.pop("HOLOZEN_LONG", None)
    return subprocess.run(
        [sys.executable, *words], cwd=tree, env=env, capture_output=True, text=True, timeout=timeout
    )


def results(tree: Path, commands: list[list[str]]) -> dict[str, Any]:
    """By command: its exit code, and what it printed to standard output and error."""
    done = run(tree, "-c", EACH, json.dumps(commands))
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("gone", GONE, ids=" ".join)
def test_without_extensions_their_verbs_say_what_is_missing_and_all_others_have_help(
    gone: list[str], without: Callable[..., Path]
) -> None:
    own = {
        verb: name
        for name in gone
        for verb in VERBS
        if table.VERBS[verb].package == f"holozen.{name}"
    }
    assert {*own.values()} == {*gone}
    shown = results(
        without(*gone), [["--help"], ["__complete", ""], *([verb, "--help"] for verb in VERBS)]
    )
    assert [shown[words][0] for words in ("--help", "__complete ")] == [0, 0]
    assert shown["__complete "][1].split() == [*table.VERBS]
    missing = {
        name: f"it needs the extension {name}, the folder extensions/{name}, which is not here\n"
        for name in gone
    }
    for verb in VERBS:
        code, out, err = shown[f"{verb} --help"]
        said = [missing[own[verb]]] if verb in own else [*missing.values()]
        lacks = (code, out) == (1, "") and err.partition(": ")[2] in said
        assert lacks or (code == 0 and verb not in own), f"{verb}: {err}"


def test_the_core_alone_makes_a_wheel_and_an_editable_install(
    without: Callable[..., Path], tmp_path: Path
) -> None:
    tree = without(*sorted(EXTENSIONS))
    done = run(
        tree, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(tree)
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    packages = {
        name.split("/")[1]
        for name in zipfile.ZipFile(wheel).namelist()
        if name.startswith("holozen/")
    }
    assert not packages & EXTENSIONS
    assert {"bus.py", "sim", "teleop", "urdf"} <= packages
    venv = tmp_path / "venv"
    assert run(tree, "-m", "venv", "--without-pip", str(venv)).returncode == 0
    pip = [
        "-m",
        "pip",
        "--python",
        str(venv),
        "install",
        "--no-deps",
        "--no-index",
        "--no-build-isolation",
        "--quiet",
    ]
    lent = next(venv.glob("lib/python*/site-packages")) / "lent.pth"
    lent.write_text("".join(f"{path}\n" for path in sys.path if path.endswith("site-packages")))
    done = run(tree, *pip, "--config-settings", "editable_mode=compat", "--editable", str(tree))
    assert done.returncode == 0, done.stderr
    code = "import holozen; print(holozen.__file__)"
    where = subprocess.run(
        [venv / "bin" / "python", "-I", "-c", code], capture_output=True, text=True, timeout=60
    )
    assert where.stdout == f"{tree}/holozen/__init__.py\n"


@pytest.mark.skipif(
    not LONG, reason="not built: the tests of the core without each extension take twelve minutes"
)
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", sorted(EXTENSIONS))
def test_without_an_extension_the_core_passes_its_tests(
    name: str, without: Callable[..., Path]
) -> None:
    tree = without(name)
    words = [
        "-p",
        "no:cacheprovider",
        "-q",
        f"--numprocesses={5 * (os.cpu_count() or 2) // 2}",
        "--dist=loadfile",
        "tests/core",
        "tests/architecture",
    ]
    run(
        tree,
        "-c",
        "import subprocess; subprocess.run(['git', 'init', '-q']); subprocess.run(['git', 'add', "
        "'-A'])",
    )
    done = run(tree, "-m", "pytest", *words, timeout=880)
    assert done.returncode == 0, done.stdout[-4000:]
