"""`holozen check`: what it explains, corrects, and prints for editors."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen import cli
from holozen.check.examples import EXAMPLES

Run = Callable[..., tuple[int, str, str]]

ROBOT = """<?xml version="1.0"?>
<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="edge" value="0.1"/>
  <xacro:macro name="part" params="name">
    <link name="${name}">
      <inertial><mass value="0.1"/></inertial>
      <collision><geometry><box size="${edge} ${edge} ${edge}"/></geometry></collision>
    </link>
    <joint name="${name}_joint" type="fixed"><parent link="base"/><child link="${name}"/></joint>
  </xacro:macro>
  <link name="base">
    <!-- <colision/> -->
    <inertial>
      <mass value="2"/>
    </inertial>
    <collision>
      <geometry><box size="0.4 0.2 0.1"/></geometry>
    </collision>
    <colision>
      <geometry><box size="0.1 0.1 0.1"/></geometry>
    </colision>
    <visual><geometry><box raduis="1" size="0.4 0.2 0.1"/></geometry></visual>
    <visual><geometry><sphere raduis="0.1"/></geometry></visual>
  </link>
  <xacro:part name="a"/>
</robot>
"""
CORRECTED = ROBOT.replace("colision>", "collision>").replace(
    'sphere raduis="0.1"', 'sphere radius="0.1"'
)
INERTIA = '      <inertia ixx="0.008333" ixy="0" ixz="0" iyy="0.02833" iyz="0" izz="0.03333"/>\n'


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run `holozen LINE` in this process: exit code, output, errors."""
    return lambda line: (cli.main(line.split()), *capsys.readouterr())


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "r.xacro"
    path.write_bytes(ROBOT.replace("\n", "\r\n").encode())
    return path


def test_what_needs_no_judgement_is_shown_then_written_and_the_old_file_is_kept(
    run: Run, robot: Path
) -> None:
    before = robot.read_bytes()
    code, out, err = run(f"check {robot} --fix")
    assert code == 0 and "nothing is written yet" in err
    assert [line for line in out.splitlines() if line.startswith(("-  ", "+  "))] == [
        "-    <colision>",
        "+    <collision>",
        "-    </colision>",
        "+    </collision>",
        '-    <visual><geometry><sphere raduis="0.1"/></geometry></visual>',
        '+    <visual><geometry><sphere radius="0.1"/></geometry></visual>',
    ]
    assert robot.read_bytes() == before and list(robot.parent.iterdir()) == [robot]

    run(f"check {robot} --fix --write")
    assert robot.read_bytes() == CORRECTED.replace("\n", "\r\n").encode()
    assert robot.with_name("r.xacro.orig").read_bytes() == before

    # Now that the file can be loaded, the inertia follows from the shapes; but not the one in the
    # macro.
    code, out, err = run(f"check {robot} --fix --write")
    assert "has a mass and no <inertia>" in out
    mass = '      <mass value="2"/>\n'
    lines = robot.read_text().splitlines()
    added = [line for line in lines if line not in CORRECTED.splitlines()]
    assert len(added) == 1 and lines[lines.index(added[0]) - 1] == mass.rstrip()
    assert added[0].startswith("      <inertia ixx=")
    assert robot.with_name("r.xacro.orig2").read_bytes() == CORRECTED.replace("\n", "\r\n").encode()

    code, out, err = run(f"check {robot} --fix --write")
    assert code == 1 and out == "" and "nothing that --fix can correct" in err


def test_the_inertia_is_that_of_the_solid_shape(run: Run, tmp_path: Path) -> None:
    text = (
        '<robot name="r"><link name="a"><inertial>\n<mass '
        'value="2"/>\n</inertial><collision><geometry>'
    )
    path = tmp_path / "r.urdf"
    path.write_text(f'{text}<box size="0.4 0.2 0.1"/></geometry></collision></link></robot>')
    run(f"check {path} --fix --write")
    assert INERTIA.strip() in path.read_text()
    assert run(f"check {path}")[0] == 0


def test_a_rule_is_explained_with_its_example(run: Run) -> None:
    code, out, _ = run("check --explain wheel-axis")
    assert code == 0 and all(part in out for part in EXAMPLES["wheel-axis"])
    code, out, _ = run("check --explain")
    assert code == 0 and [line.split()[0] for line in out.splitlines()] == [*EXAMPLES]
    code, _, err = run("check --explain wheel-axs")
    assert code == 2 and "did you mean 'wheel-axis'?" in err


def test_editors_get_the_line_of_the_source(run: Run, robot: Path) -> None:
    code, out, _ = run(f"check {robot} --sarif")
    log = json.loads(out)
    assert code == 1 and log["version"] == "2.1.0"
    (one,) = log["runs"]
    rules = [rule["id"] for rule in one["tool"]["driver"]["rules"]]
    assert rules == [*EXAMPLES]
    found = {
        result["ruleId"]: result["locations"][0]["physicalLocation"]["region"]["startLine"]
        for result in one["results"]
    }
    assert found["tag"] == ROBOT[: ROBOT.index("<colision>")].count("\n") + 1
    for result in one["results"]:
        assert (
            result["level"] in ("error", "warning")
            and rules[result["ruleIndex"]] == result["ruleId"]
        )
        assert (
            result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == robot.as_uri()
        )


@pytest.mark.parametrize("flags", ["--fix --json", "--fix --sarif", "--json --sarif", "--write"])
def test_outputs_are_not_mixed(
    run: Run, robot: Path, flags: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = robot.read_bytes()
    with pytest.raises(SystemExit) as end:
        run(f"check {robot} {flags}")
    out, err = capsys.readouterr()
    assert end.value.code == 2 and out == "" and len(err.splitlines()) == 1
    assert list(robot.parent.iterdir()) == [robot] and robot.read_bytes() == before
