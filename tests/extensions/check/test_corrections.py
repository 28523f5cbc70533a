"""What `check --fix` changes in a file, and what it leaves alone because it is not sure."""

from pathlib import Path

import pytest

from holozen.check.corrections import correct
from tests.extensions.check.conftest import Findings

MASS = '<inertial><mass value="1"/></inertial>'
BOX = "<collision><geometry><box size='{0} {0} {0}'/></geometry></collision>"
JOINT = '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'


def moments(value: str) -> str:
    return f'<inertia ixx="{value}" ixy="0" ixz="0" iyy="{value}" iyz="0" izz="{value}"/>'


def weighed(inertia: str) -> str:
    return MASS.replace("</", f"{inertia}</")


def corrected(text: str, findings: Findings, folder: Path) -> str:
    """The text of a robot, corrected; `text` is what is in it."""
    robot = f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n{text}\n</robot>'
    name = "robot.xacro" if "xacro:" in text else "robot.urdf"
    whole = correct(robot, str(folder / name), findings(robot, name))[0]
    return whole.removeprefix(robot[: robot.index(text)]).removesuffix("\n</robot>")


def test_all_that_is_alike_on_one_line_is_corrected_and_no_value(
    findings: Findings, tmp_path: Path
) -> None:
    part = '<visual name="raduis=1"><geometry><cylinder raduis="1" length="2"/></geometry></visual>'
    text = (
        f'<link name="a">{weighed(moments("1"))}{part}{part}<!-- <cylinder raduis="1"/> --></link>'
    )
    expected = text.replace('cylinder raduis="1" length', 'cylinder radius="1" length')
    assert corrected(text, findings, tmp_path) == expected


def test_each_of_two_links_on_one_line_gets_its_own_inertia(
    findings: Findings, tmp_path: Path
) -> None:
    text = (
        f'<link name="a">{MASS}{BOX.format(1)}</link><link '
        f'name="b">{MASS}{BOX.format(2)}</link>{JOINT}'
    )
    first, a, b = text.split("</inertial>")
    expected = f"{first}{moments('0.1667')}</inertial>{a}{moments('0.6667')}</inertial>{b}"
    assert corrected(text, findings, tmp_path) == expected


def test_lines_are_counted_as_xml_counts_them(findings: Findings, tmp_path: Path) -> None:
    text = f'<link name="a\u2028\u0085">\n{MASS}\n{BOX.format(1)}</link>'
    assert corrected(text, findings, tmp_path) == text.replace(
        "</inertial>", f"{moments('0.1667')}</inertial>"
    )


MACRO = f'<xacro:macro name="part">\n{MASS}\n</xacro:macro>'
USES = "".join(
    f'<link name="{name}"><xacro:part/>{BOX.format(size)}</link>'
    for name, size in (("a", 1), ("b", 2))
)
COMMENTED = moments("0").replace("/>", "><!-- as weighed --></inertia>")
MISSPELT = '<inertia ixx="1" iyy="1" izz="1" ivz="0"/>'
TWICE = '<origin xyz="1 0 0" xzy="0 0 0"/>'


@pytest.mark.parametrize(
    "text",
    [
        f"{MACRO}{USES}{JOINT}",
        '<xacro:arg name="m" default="2"/><link '
        f'name="a">{MASS.replace("1", "$(arg m)")}{BOX.format(1)}</link>',
        f'<link name="a">{MASS}<collision><geometry><mesh '
        'filename="none.stl"/></geometry></collision></link>',
        f'<link name="a">{weighed(COMMENTED)}{BOX.format(1)}</link>',
        f'<link name="a">{weighed(MISSPELT)}{BOX.format(1)}</link>',
        f'<link name="a">{BOX.format(1).replace("<geom", f"{TWICE}<geom")}</link>',
    ],
    ids=[
        "macro of two links",
        "argument",
        "missing mesh",
        "comment",
        "ixz or iyz",
        "attribute twice",
    ],
)
def test_what_needs_judgement_is_left_alone(text: str, findings: Findings, tmp_path: Path) -> None:
    assert corrected(text, findings, tmp_path) == text
