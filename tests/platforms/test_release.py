"""The files of a release: their schemas, and what scripts/release refuses."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
SCHEMAS = {
    "vendor.github-workflows": ".github/workflows/*.yml",
    "vendor.dependabot": ".github/dependabot.yml",
    "vendor.github-issue-forms": ".github/ISSUE_TEMPLATE/bug.yml",
}


@pytest.mark.parametrize("schema", SCHEMAS)
def test_it_has_its_schema(schema: str) -> None:
    words = [str(Path(sys.executable).with_name("check-jsonschema")), "--builtin-schema", schema]
    files = sorted(map(str, REPO.glob(SCHEMAS[schema])))
    done = subprocess.run([*words, *files], capture_output=True, text=True)
    assert files and done.returncode == 0, done.stdout


def test_the_workflows_try_every_python_that_the_set_up_takes() -> None:
    tests = (REPO / ".github" / "workflows" / "tests.yml").read_text()
    assert 'python: ["3.11", "3.12", "3.13", "3.14"]' in tests
    assert "(3, 11) <= sys.version_info[:2] <= (3, 14)" in (REPO / "scripts" / "venv").read_text()


def test_a_release_needs_a_dated_heading_in_the_changelog(tmp_path: Path) -> None:
    (tmp_path / "scripts").mkdir()
    for name in ("scripts/release", "pyproject.toml"):
        shutil.copy(REPO / name, tmp_path / name)
    (tmp_path / "CHANGELOG.md").write_text("## Unreleased\n")
    words = [tmp_path / "scripts" / "release"]
    done = subprocess.run([*words, "--no-tag"], capture_output=True, text=True)
    version = re.search(r'^version = "(.+)"$', (REPO / "pyproject.toml").read_text(), re.MULTILINE)
    assert version
    expected = f"release: CHANGELOG.md has no heading '## {version[1]} - YYYY-MM-DD'\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", expected)
    done = subprocess.run([*words, "--upload"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (
        1,
        "release: --upload: use scripts/release [--no-tag]\n",
    )
