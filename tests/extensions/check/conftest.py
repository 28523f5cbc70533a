"""A good robot, of which each test breaks one part, and its findings."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from holozen.check.mistake import Finding
from holozen.check.report import check
from holozen.robot.files import reader
from tests.expansions import forked

__all__ = ["forked"]

Findings = Callable[..., list[Finding]]

HERE = Path(__file__).parent


@pytest.fixture
def good() -> str:
    """A URDF robot: two driven wheels, a ball, an arm with a slide, and fingers that mimic each
    other.
    """
    return (HERE / "good.urdf").read_text()


@pytest.fixture
def good_sdf() -> str:
    """An SDF robot on two wheels and a ball."""
    return (HERE / "good.sdf").read_text()


def check_here(path: Path, **options: Any) -> list[Finding]:
    """The findings in a file, by a reader in this process: to fork one a file takes longer than to
    check it. The tests of the verb have the real one.
    """

    def run(
        _kind: object,
        _what: object,
        function: Callable[..., object],
        *args: object,
        handlers: Mapping[str, reader.Handler] = {},
        **_limits: object,
    ) -> object:
        with pytest.MonkeyPatch.context() as patch:
            if handlers:
                patch.setattr(reader, "ask", lambda name, *rest: handlers[name](*rest))
            return function(*args)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reader, "run", run)
        return check(path, **options)[0]


@pytest.fixture
def findings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forked: None) -> Findings:
    """The findings in a text, saved under a name in an empty folder."""
    for variable in (
        "AMENT_PREFIX_PATH",
        "ROS_PACKAGE_PATH",
        "GAZEBO_MODEL_PATH",
        "GZ_SIM_RESOURCE_PATH",
    ):
        monkeypatch.delenv(variable, raising=False)

    def look(text: str, name: str = "robot.urdf", **options: object) -> list[Finding]:
        (tmp_path / name).write_text(text)
        return check_here(tmp_path / name, **options)

    return look


@pytest.fixture
def rules(findings: Findings) -> Callable[..., list[str]]:
    """The names of the rules that a text breaks."""
    return lambda *args, **options: sorted({finding.rule for finding in findings(*args, **options)})


def stl(path: Path, size: float) -> None:
    """A tetrahedron with edges of `size` along the axes."""
    corners = [(0.0, 0.0, 0.0), (size, 0.0, 0.0), (0.0, size, 0.0), (0.0, 0.0, size)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    rows = [
        struct.pack("<12fH", 0, 0, 0, *(x for i in face for x in corners[i]), 0) for face in faces
    ]
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(rows)) + b"".join(rows))
