"""Meshes that are lost, empty, or in the wrong unit."""

from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.check.subject import Requirements
from tests.extensions.check.conftest import Findings, stl

BOX = '<visual><geometry><box size="0.3 0.2 0.1"/></geometry>'
Rules = Callable[..., list[str]]


def with_mesh(good: str, uri: str, scale: str = "1 1 1") -> str:
    assert BOX in good
    return good.replace(
        BOX, f'<visual><geometry><mesh filename="{uri}" scale="{scale}"/></geometry>'
    )


def test_a_mesh_of_the_right_size_is_silent(good: str, rules: Rules, tmp_path: Path) -> None:
    stl(tmp_path / "body.stl", 0.3)
    assert rules(with_mesh(good, "body.stl")) == []


def test_a_mesh_that_is_not_there(good: str, findings: Findings) -> None:
    (finding,) = findings(with_mesh(good, "body.stl"))
    assert (finding.rule, finding.severity) == ("mesh", "error")
    assert "'body.stl'" in finding.problem


def test_a_mesh_at_a_path_of_another_machine(good: str, rules: Rules, tmp_path: Path) -> None:
    stl(tmp_path / "body.stl", 0.3)
    assert rules(with_mesh(good, "file:///home/asha/ws/meshes/body.stl")) == ["mesh-path"]


@pytest.mark.parametrize(
    "content", [b"", b"solid x\nendsolid x\n", b"\0" * 84, b"\0" * 80 + b"\xff\xff\xff\x7f"]
)
def test_a_mesh_with_nothing_in_it(content: bytes, good: str, rules: Rules, tmp_path: Path) -> None:
    (tmp_path / "body.stl").write_bytes(content)
    assert rules(with_mesh(good, "body.stl")) == ["mesh-empty"]


@pytest.mark.parametrize("name", ["body.stl", "body.dae", "body.obj"])
def test_a_mesh_that_git_lfs_has_not_fetched(
    name: str, good: str, findings: Findings, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(
        "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
    )
    (finding,) = findings(with_mesh(good, name))
    assert finding.rule == "mesh-empty"
    assert (
        finding.problem
        == f"mesh {tmp_path / name}: is a Git LFS pointer, not a mesh; run: git lfs pull"
    )
    assert finding.fix == "then check again"


@pytest.mark.parametrize(
    ("uri", "fix"),
    [
        ("package://lost/a.stl", "write package://PACKAGE"),
        ("model://lost/a.stl", "GAZEBO_MODEL_PATH"),
    ],
)
def test_where_a_package_was_looked_for_is_reported_once(
    uri: str, fix: str, good: str, findings: Findings
) -> None:
    other = '<sphere radius="0.015"/>'
    assert other in good
    found = findings(with_mesh(good, uri).replace(other, f'<mesh filename="{uri}"/>'))
    first, second = (finding for finding in found if finding.rule == "mesh")
    assert "packages found" in first.problem and "looked in" in first.problem
    assert second.problem.endswith("there is no package 'lost'")
    assert fix in first.fix and fix in second.fix


@pytest.mark.parametrize(
    ("size", "scale", "fix"),
    [
        (300.0, "1 1 1", 'scale="0.001 0.001 0.001" makes it 0.3 m'),
        (0.3, "0.001 0.001 0.001", 'scale="1 1 1" makes it 0.3 m'),
        (0.3, "0.01 0.01 0.01", 'scale="1 1 1" makes it 0.3 m'),
        (30.0, "1 1 1", 'scale="0.01 0.01 0.01" makes it 0.3 m'),
        (11.8, "1 1 1", 'scale="0.0254 0.0254 0.0254" makes it 0.3 m'),
    ],
)
def test_a_mesh_in_another_unit(
    size: float, scale: str, fix: str, good: str, findings: Findings, tmp_path: Path
) -> None:
    stl(tmp_path / "body.stl", size)
    (finding,) = findings(with_mesh(good, "body.stl", scale))
    assert finding.rule == "mesh-unit"
    assert fix in finding.fix


def test_a_mesh_that_is_only_seen_does_not_count_for_the_size(
    good: str, rules: Rules, tmp_path: Path
) -> None:
    stl(tmp_path / "body.stl", 0.6)
    assert rules(with_mesh(good, "body.stl"), requirements=Requirements((0.31, 0.28))) == []


def test_a_small_part_is_no_mistake(good: str, rules: Rules, tmp_path: Path) -> None:
    stl(tmp_path / "screw.stl", 0.006)
    screw = (
        '<link name="s"><visual><geometry><mesh filename="screw.stl"/></geometry></visual></link>'
    )
    joint = '<joint name="sj" type="fixed"><parent link="base"/><child link="s"/></joint>'
    assert rules(good.replace("</robot>", screw + joint + "</robot>")) == []
