"""The pages of docs/ do what they say, step by step, in a checkout on a machine of their own."""

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.faults.namespaces import NEEDS, Lab
from tests.pages import PAGES, READ, REPO, STEP

WITHIN = 240.0  # s for a page
FOLLOWED = [
    page for page in PAGES if {step["language"] for step in STEP.finditer(page.read_text())} - READ
]


@pytest.fixture(scope="module")
def follow() -> Iterator[Callable[[str, Path], None]]:
    """`follow(page, folder)`: all pages are followed on one machine, by one process."""
    read, write = os.pipe()
    with Lab() as lab, open(read, "rb") as lines, open(write, "w", buffering=1) as asked:
        words = (sys.executable, "-m", "tests.pages")
        reader = lab.host("machine").start(*words, stdin=lines)

        def follow(page: str, folder: Path) -> None:
            before = len(reader.out), len(reader.err)
            asked.write(f"{page} {folder}\n")
            end = reader.wait_for_line(f"{page}: ", WITHIN)
            assert end.endswith(" steps"), reader.out[before[0] :] + reader.err[before[1] :]

        yield follow


@NEEDS
@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", [str(page.relative_to(REPO).with_suffix("")) for page in FOLLOWED])
def test_a_page_does_what_it_says(
    page: str, tmp_path: Path, follow: Callable[[str, Path], None]
) -> None:
    for name in (".venv", "examples", "meshes", "pyproject.toml", "urdf", "worlds"):
        (tmp_path / name).symlink_to(REPO / name)
    follow(page, tmp_path)
