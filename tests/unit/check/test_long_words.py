"""No finding grows with the words of the file that it tells of."""

from pathlib import Path

import pytest

from holozen.check.report import check

LONG = "x" * 300_000
MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'


@pytest.mark.parametrize(
    "parts",
    [
        f'<gazebo><plugin name="p" filename="{LONG}"/></gazebo>',
        f'<gazebo reference="{LONG}"/>',
        f'<gazebo reference="{"x " * 10_000}"/>',
        f'<link name="{LONG}"/>',
        f'<joint name="j" type="{LONG}"><parent link="a"/><child link="a"/></joint>',
        f'<joint name="j" type="fixed"><parent link="{LONG}"/><child link="a"/></joint>',
    ],
    ids=range(6),
)
def test_a_long_word_of_the_file_does_not_make_a_long_finding(parts: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    file.write_text(f'<robot name="r"><link name="a">{MASS}</link>{parts}</robot>')
    findings = check(file)
    assert findings
    assert all(len(str(finding)) < 5000 for finding in findings)
