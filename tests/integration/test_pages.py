"""The pages of docs/ do what they say, step by step, in a checkout on a machine of their own."""

import sys
from pathlib import Path

import pytest

from tests.faults.namespaces import NEEDS, Lab
from tests.pages import PAGES, READ, REPO, STEP

FOLLOWED = [
    page for page in PAGES if {step["language"] for step in STEP.finditer(page.read_text())} - READ
]


@NEEDS
@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", [str(page.relative_to(REPO).with_suffix("")) for page in FOLLOWED])
def test_a_page_does_what_it_says(page: str, tmp_path: Path) -> None:
    for name in (".venv", "examples", "meshes", "pyproject.toml", "urdf", "worlds"):
        (tmp_path / name).symlink_to(REPO / name)
    with Lab() as lab:
        done = lab.host("machine").run(
            sys.executable, "-m", "tests.pages", page, str(tmp_path), within=240
        )
    assert done.returncode == 0, done.stdout + done.stderr
