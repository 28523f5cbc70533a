"""The pages of docs/ do what they say, step by step, in a checkout on a machine of their own."""

import sys
from pathlib import Path

import pytest

from tests.faults.namespaces import NEEDS, Lab
from tests.pages import DOCS, READ, REPO, STEP

PAGES = [page for page in DOCS.glob("**/*.md") if {step["language"] for step in STEP.finditer(page.read_text())} - READ]


@NEEDS
@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", sorted(str(page.relative_to(DOCS).with_suffix("")) for page in PAGES))
def test_a_page_does_what_it_says(page: str, tmp_path: Path) -> None:
    for name in (".venv", "deploy", "examples", "meshes", "pyproject.toml", "urdf", "worlds"):
        (tmp_path / name).symlink_to(REPO / name)
    with Lab() as lab:
        done = lab.host("machine").run(sys.executable, "-m", "tests.pages", page, str(tmp_path), within=240)
    assert done.returncode == 0, done.stdout + done.stderr
