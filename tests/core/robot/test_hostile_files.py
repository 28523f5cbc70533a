"""URDF and SDF texts, and meshes, that are meant to do harm: each is a model or an error of one
line, takes a bounded memory, and one that came over the network opens no file outside known
packages.
"""

import contextlib
import gzip
import os
import re
import resource
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.description import read
from holozen.robot.files.loading import both, load, parse, received
from holozen.robot.files.meshes import MAX_SHOWN, file_in
from holozen.robot.files.sdf_world import load_world
from holozen.robot.files.xacro import expand_xacro
from tests.hostile import MESHES, data, laid_out
from tests.present import VERBS

MAX_MEMORY = 200e6  # bytes that all of them may take beyond what was taken before


class Watch:
    """The files that are opened while it is on. A hook of Python's cannot be removed again."""

    def __init__(self) -> None:
        self.is_on, self.opened = False, list[str]()
        sys.addaudithook(self._note)

    def _note(self, event: str, args: tuple[object, ...]) -> None:
        if self.is_on and event in (
            "open",
            "socket.connect",
            "subprocess.Popen",
            "os.exec",
            "os.system",
        ):
            self.opened.append(f"{event} {args[0]}")


@pytest.fixture(scope="module")
def watch() -> Iterator[Watch]:
    watch = Watch()
    yield watch
    watch.is_on = False


def test_a_hostile_text_opens_nothing_takes_little_and_is_reported_in_a_line(
    tmp_path: Path, watch: Watch
) -> None:
    package, texts = laid_out(tmp_path)
    allowed = [f"open {package / file}" for file in ("package.xml", "model.sdf", *MESHES)]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for name, text in texts:
        watch.opened.clear()
        watch.is_on = True
        try:
            parse(text, Path("resource_string"), {"bot": package}, confined=True)
        except RobotError as error:
            assert "\n" not in str(error) and len(str(error)) < 1000, name
        finally:
            watch.is_on = False
        # what Python imports late
        opened = [one for one in watch.opened if not one.endswith((".py", ".pyc"))]
        assert all(one in allowed for one in opened), (name, opened)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MAX_MEMORY


def test_a_packed_mesh_that_unpacks_to_more_than_is_shown_is_refused_before_it_is_unpacked() -> (
    None
):
    zeros = gzip.compress(bytes(1_000_000), 9)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for packed in (zeros * 300, zeros[:-4] + b"yyyy", b"", b"x" * 1000):
        with contextlib.suppress(RobotError):
            assert len(file_in(data("stl+gzip", packed))[1]) <= MAX_SHOWN
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MAX_MEMORY


def checked(file: Path, package: Path) -> object:
    """What `check` says of a file."""
    from holozen.check.report import check

    return check(file, {}, {"bot": package})


WAYS: dict[str, Callable[[Path, Path], object]] = {
    "spawn_entity": lambda file, package: received(file.read_text(), {"bot": package}),
    "description": lambda file, _package: read(file.read_text()),
    "xacro": lambda file, package: expand_xacro(file, {}, {"bot": package}),
    "spawn": lambda file, package: both(file, {}, {"bot": package}, False, ()),
    "sim --robot": lambda file, package: load(file, {}, {"bot": package}),
    "sim --world": lambda file, package: load_world(file, {"bot": package}),
    **({"check": checked} if "check" in VERBS else {}),
}


TURNS = len(WAYS) if os.environ.get("HOLOZEN_LONG") == "1" else 1


@pytest.mark.parametrize("turn", range(TURNS))
def test_a_hostile_file_is_a_robot_or_an_error_of_one_line_wherever_it_is_read(
    tmp_path: Path, turn: int
) -> None:
    """Each file in each way with `--long`, else in one of them."""
    ways = [*WAYS.values()]
    package, texts = laid_out(tmp_path)
    for number, (name, text) in enumerate(texts):
        file = tmp_path / f"{number}.urdf"
        file.write_text(text)
        try:
            ways[(number + turn) % len(ways)](file, package)
        except RobotError as error:
            assert not re.search(r"\n|its reader|it cannot be read", str(error)), name
