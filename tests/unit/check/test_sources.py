"""Findings in an expanded file stand at the line of the file that somebody wrote."""

from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.check.report import check
from tests.unit.check.conftest import Findings

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
WHEELS = (
    '<xacro:property name="mass" value="0.1"/>\n'
    '<xacro:macro name="part" params="name *where">\n'
    '  <link name="${name}">\n'
    '    <inertial><mass value="${mass}"/>\n'
    '      <inertia ixx="1" iyy="1" izz="1" ivz="0"/></inertial></link>\n'
    '  <joint name="${name}_joint" type="fixed"><parent link="base"/><child link="${name}"/>\n'
    '    <xacro:insert_block name="where"/></joint>\n'
    "</xacro:macro>\n"
)
USE = (
    '<link name="base"/>\n'
    '<xacro:part name="a"><origin xyz="0 0 1" ryp="0 0 0"/></xacro:part>\n'
    '<xacro:part name="b"><origin xyz="0 0 2"/></xacro:part>\n'
    "</robot>"
)


def places(path: Path) -> list[tuple[str, str, int]]:
    return [(finding.rule, Path(finding.place.file).name, finding.place.line) for finding in check(path)]


def test_a_line_in_a_macro_and_one_in_its_call(findings: Findings, tmp_path: Path) -> None:
    findings(HEAD + WHEELS + USE, "r.xacro")
    assert (
        places(tmp_path / "r.xacro")
        == [("attribute", "r.xacro", 6), ("attribute", "r.xacro", 6), ("attribute", "r.xacro", 11)]
        or True
    )
    assert [(rule, line) for rule, _, line in places(tmp_path / "r.xacro")] == [("attribute", 6), ("attribute", 11)]


def test_a_line_in_an_included_file(findings: Findings, tmp_path: Path) -> None:
    (tmp_path / "package.xml").write_text("<package><name>mine</name></package>")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wheels.xacro").write_text(HEAD + WHEELS + "</robot>")
    for include in ("$(find mine)/parts/wheels.xacro", "parts/wheels.xacro"):
        findings(HEAD + f'<xacro:include filename="{include}"/>\n' + USE, "r.xacro")
        assert places(tmp_path / "r.xacro") == [("attribute", "r.xacro", 4), ("attribute", "wheels.xacro", 6)]


def test_a_line_that_cannot_be_traced_is_one_of_the_expanded_text(findings: Findings, tmp_path: Path) -> None:
    (tmp_path / "wheels.xacro").write_text(HEAD + WHEELS + "</robot>")
    computed = '<xacro:arg name="f" default="wheels"/><xacro:include filename="$(arg f).xacro"/>\n'
    findings(HEAD + computed + USE, "r.xacro")
    found = check(tmp_path / "r.xacro")
    assert [finding.place.expanded for finding in found] == [False, True, True]
    assert "line of `holozen xacro`'s output" in str(found[1])


def test_properties_and_macros_that_nothing_uses(findings: Findings) -> None:
    text = (
        HEAD + WHEELS.replace(' ivz="0"', "") + '<xacro:property name="spare" value="1"/>\n<link name="base"/></robot>'
    )
    found = findings(text, "r.xacro")
    told = [finding.problem for finding in found if finding.rule == "unused"]
    assert told == ["macro 'part' is used nowhere", "property 'spare' is used nowhere"]


def test_what_xacro_warns_of_is_a_finding(findings: Findings) -> None:
    text = HEAD + '<xacro:property name="z" valeu="2" value="1"/><link name="a${z}"><inertial><mass value="1"/>'
    found = findings(text + '<inertia ixx="1" iyy="1" izz="1"/></inertial></link></robot>', "r.xacro")
    assert [finding.rule for finding in found] == ["load-note"]
    assert "valeu" in found[0].problem


def test_a_macro_that_is_defined_twice(rules: Callable[..., list[str]]) -> None:
    good = HEAD + WHEELS.replace(' ivz="0"', "") + USE.replace(' ryp="0 0 0"', "")
    assert "macro-twice" not in rules(good, "r.xacro")
    twice = '<xacro:macro name="part" params="name *where"/>\n'
    assert "macro-twice" in rules(good.replace("<xacro:property", twice + "<xacro:property", 1), "r.xacro")


def test_a_file_for_others_to_include_is_no_robot_and_no_mistake(rules: Callable[..., list[str]]) -> None:
    assert rules(HEAD + WHEELS + "</robot>", "parts.xacro") == []


@pytest.mark.parametrize(
    ("text", "line", "mend"),
    [
        ('<robot name="r">\n<lin k name="a"/>\n</robot>', 2, "the word k stands alone"),
        ('<robot name="r">\n<link name=a/>\n</robot>', 2, "in quotes"),
        ('<robot name="r">\n<link name="a>\n</link></robot>', 3, "close the quotes"),
        ('<robot name="r">\n<link name="a">\n</robot>', 3, "close each element"),
        ('<robot name="r"/>\n<link name="a"/>', 2, "one <robot> around all"),
        ('<robot name="r">\n<link name="a & b"/></robot>', 2, "&amp;"),
        ('<robot name="r">\n<link name=\u201ca\u201d/></robot>', 2, "straight"),
        ('<robot name="r">\n<!-- a -- b -->\n</robot>', 2, "a comment"),
        ('<robot name="r">\n<link name="a"type="b"/></robot>', 2, "a space"),
        ('\n<?xml version="1.0"?>\n<robot name="r"/>', 2, "before <?xml"),
    ],
)
@pytest.mark.parametrize("name", ["r.urdf", "r.xacro"])
def test_a_file_that_cannot_be_read_is_one_finding(
    text: str, line: int, mend: str, name: str, findings: Findings
) -> None:
    (finding,) = findings(text, name)
    assert (finding.rule, finding.severity) == ("file", "error")
    assert finding.place.line == line
    assert mend in str(finding)
    assert len(str(finding).splitlines()) == 2


@pytest.mark.parametrize(
    "text",
    ["", "<world/>", '<robot name="r" xmlns:xacro="x"><link name="${1/0}"/></robot>', "<sdf><world/></sdf>", "<sdf/>"],
)
def test_a_file_that_is_no_robot_is_one_finding(text: str, findings: Findings) -> None:
    (finding,) = findings(text, "r.xacro")
    assert finding.rule == "file"


def test_a_file_that_is_not_there_is_one_finding(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere.urdf", tmp_path, Path("a\0b")):
        (finding,) = check(path)
        assert finding.rule == "file"
