"""The pages of the tutorial do what they say, step by step, in a checkout on a machine of their own."""

import re
import sys
from pathlib import Path

import pytest

from holozen.testing import Process, Wire
from tests.faults.namespaces import NEEDS, Lab
from tests.pages import REPO, TUTORIAL

PAGES = sorted(page.stem for page in TUTORIAL.glob("*.md"))


@NEEDS
@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", PAGES)
def test_a_page_does_what_it_says(page: str, tmp_path: Path) -> None:
    for name in (".venv", "examples", "meshes", "urdf", "worlds"):
        (tmp_path / name).symlink_to(REPO / name)
    with Lab() as lab:
        done = lab.host("machine").run(sys.executable, "-m", "tests.pages", page, str(tmp_path), within=240)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_example_of_the_page_about_python_runs(wire: Wire) -> None:
    wire.start("sim", "--robot", "urdf/hb_bot.urdf.xacro=Fred").wait_for_line("listens on")
    found = re.search(r"^```python\n(.*?)^```$", (TUTORIAL.parent / "python.md").read_text(), re.M | re.S)
    assert found
    shows = "print(age, received.message, reply.success)"
    with Process([sys.executable, "-c", f"{found[1]}    {shows}"], env={"HOLOZEN_CONNECT": wire.endpoint}) as example:
        assert example.wait() == 0, example.err
        assert example.out.endswith("True\n")
