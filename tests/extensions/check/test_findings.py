"""Findings name the source line, and suggest the word that was meant."""

from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.check.mistake import Finding
from holozen.check.report import check
from holozen.check.rules_xml import PLUGIN, URDF
from holozen.check.spelling import distance, nearest
from holozen.robot.errors import RobotError
from holozen.robot.files.loading import load
from tests.extensions.check.conftest import Findings

BALL = '<collision><geometry><sphere radius="1"/></geometry></collision>'
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
    f'<link name="base">{BALL}</link>\n'
    '<xacro:part name="a"><origin xyz="0 0 1" ryp="0 0 0"/></xacro:part>\n'
    '<xacro:part name="b"><origin xyz="0 0 2"/></xacro:part>\n'
    "</robot>"
)


def places(found: list[Finding]) -> list[tuple[str, str, int]]:
    return [(finding.rule, Path(finding.place.file).name, finding.place.line) for finding in found]


def test_a_line_in_a_macro_and_one_in_its_call(findings: Findings) -> None:
    found = findings(HEAD + WHEELS + USE, "r.xacro")
    assert [(rule, line) for rule, _, line in places(found)] == [
        ("attribute", 6),
        ("attribute", 11),
    ]


def test_a_name_that_a_macro_uses_twice_has_the_lines_of_both_calls(
    findings: Findings, tmp_path: Path
) -> None:
    text = (
        HEAD
        + WHEELS.replace(' ivz="0"', "")
        + USE.replace(' ryp="0 0 0"', "").replace('name="b"', 'name="a"')
    )
    twice = [finding.problem for finding in findings(text, "r.xacro") if finding.rule == "twice"]
    path = tmp_path / "r.xacro"
    end = f"is defined twice, in macro 'part' called at {path}:11 and at {path}:12"
    assert twice == [f"<link name='a'> {end}", f"<joint name='a_joint'> {end}"]
    with pytest.raises(RobotError) as error:
        load(path)
    assert str(error.value).endswith(f"a unique name (in macro 'part' called at {path}, line 12)")
    nested = text.replace(
        "<xacro:part name", '<xacro:macro name="pair" params=""><xacro:part name', 1
    )
    nested = nested.replace("</robot>", "</xacro:macro><xacro:pair/></robot>")
    assert any(f"first at {path}:4" in finding.problem for finding in findings(nested, "r.xacro"))


def test_a_line_in_an_included_file(findings: Findings, tmp_path: Path) -> None:
    (tmp_path / "package.xml").write_text("<package><name>mine</name></package>")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wheels.xacro").write_text(HEAD + WHEELS + "</robot>")
    for include in ("$(find mine)/parts/wheels.xacro", "parts/wheels.xacro"):
        found = findings(HEAD + f'<xacro:include filename="{include}"/>\n' + USE, "r.xacro")
        assert places(found) == [("attribute", "r.xacro", 4), ("attribute", "wheels.xacro", 6)]


def test_a_line_that_cannot_be_traced_is_one_of_the_expanded_text(
    findings: Findings, tmp_path: Path
) -> None:
    (tmp_path / "wheels.xacro").write_text(HEAD + WHEELS + "</robot>")
    computed = '<xacro:arg name="f" default="wheels"/><xacro:include filename="$(arg f).xacro"/>\n'
    found = findings(HEAD + computed + USE, "r.xacro")
    assert [finding.place.expanded for finding in found] == [False, True, True]
    assert "line of `holozen xacro`'s output" in str(found[1])


def test_properties_and_macros_that_nothing_uses(findings: Findings) -> None:
    spare = '<!-- ${size} --><xacro:property name="size" value="1"/>\n'  # a word of URDF, too
    text = (
        HEAD
        + WHEELS.replace(' ivz="0"', "")
        + spare
        + '<link name="base"><visual size="1"/></link></robot>'
    )
    found = findings(text, "r.xacro")
    message = [finding.problem for finding in found if finding.rule == "unused"]
    assert message == ["macro 'part' is not used", "property 'size' is not used"]


def test_a_call_of_a_macro_without_the_prefix_is_told_to_write_it(findings: Findings) -> None:
    found = findings(
        HEAD
        + WHEELS
        + USE.replace('xacro:part name="b"', 'part name="b"').replace(
            '0 0 2"/></xacro:part', '0 0 2"/></part'
        ),
        "r.xacro",
    )
    assert [finding.fix for finding in found if finding.rule == "ignored"] == [
        "write <xacro:part> to call the macro"
    ]


def test_an_argument_that_nothing_asks_for_is_a_finding(findings: Findings, good: str) -> None:
    found = findings(good, args={"size": "1"})
    assert [(finding.rule, finding.place.line) for finding in found] == [("load-note", 0)]
    assert found[0].problem == "there is no argument 'size'; its arguments are: none"
    text = good.replace('<robot name="good">', HEAD).replace(
        "<link ", '<xacro:arg name="size" default="1"/><link ', 1
    )
    assert findings(text, "r.xacro", args={"size": "1"}) == []
    found = findings(text, "r.xacro", args={"szie": "1"})
    assert [(finding.rule, finding.place.line) for finding in found] == [("load-note", 0)]
    problem = "there is no argument 'szie' (did you mean 'size'?); its arguments are: size"
    assert found[0].problem == problem


def test_what_xacro_warns_of_is_a_finding(findings: Findings) -> None:
    text = (
        HEAD + '<xacro:property name="z" valeu="2" value="1"/><link name="a${z}"><inertial><mass '
        'value="1"/>'
    )
    found = findings(
        text + '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
        f'iyz="0"/></inertial>{BALL}</link></robot>',
        "r.xacro",
    )
    assert [finding.rule for finding in found] == ["load-note"]
    assert "valeu" in found[0].problem


def test_a_macro_that_is_defined_twice(rules: Callable[..., list[str]]) -> None:
    good = HEAD + WHEELS.replace(' ivz="0"', "") + USE.replace(' ryp="0 0 0"', "")
    assert "macro-twice" not in rules(good, "r.xacro")
    twice = '<xacro:macro name="part" params="name *where"/>\n'
    assert "macro-twice" in rules(
        good.replace("<xacro:property", twice + "<xacro:property", 1), "r.xacro"
    )


def test_an_include_of_another_machine_is_a_finding_and_its_lines_are_known(
    findings: Findings, tmp_path: Path
) -> None:
    (tmp_path / "wheels.xacro").write_text(HEAD + WHEELS + "</robot>")
    include = '<xacro:include filename="/home/asha/ws/wheels.xacro"/>\n'
    found = findings(HEAD + include + USE, "r.xacro")
    note = next(finding for finding in found if finding.rule == "load-note")
    assert "; write wheels.xacro" in note.problem and note.place.line == 2
    assert ("attribute", "wheels.xacro", 6) in places(found)


def test_a_file_for_others_to_include_is_no_robot_and_no_mistake(
    rules: Callable[..., list[str]],
) -> None:
    assert rules(HEAD + WHEELS + "</robot>", "parts.xacro") == []


def test_a_part_of_a_robot_without_a_name_is_to_be_checked_with_its_robot(
    findings: Findings,
) -> None:
    found = findings(
        HEAD.replace(' name="r"', "") + f'<link name="base">{BALL}</link></robot>', "core.xacro"
    )
    assert [finding.fix for finding in found if finding.rule == "load"] == [
        "add one; to check a file that others include, check the file that includes it"
    ]


def test_a_file_that_cannot_be_read_is_one_finding(findings: Findings) -> None:
    for name in ["r.urdf", "r.xacro"]:
        for text, line, fix in [
            ('<robot name="r">\n<lin k name="a"/>\n</robot>', 2, "the word k has no value"),
            ('<robot name="r">\n<link name=a/>\n</robot>', 2, "in quotes"),
            ('<robot name="r">\n<link name="a>\n</link></robot>', 3, "close the quotes"),
            ('<robot name="r">\n<link name="a">\n</robot>', 3, "close each element"),
            (
                '<robot name="r"/>\n<link name="a"/>',
                2,
                "a single <robot> or <sdf> around everything: remove",
            ),
            ('<robot name="r">\n<link name="a & b"/></robot>', 2, "&amp;"),
            ('<robot name="r">\n<link name=\u201ca\u201d/></robot>', 2, "straight"),
            ('<robot name="r">\n<link\u00a0name="a"/></robot>', 2, "the no-break spaces"),
            ('{\\rtf1 <robot name="r"/>}', 1, "save the file as plain text"),
            ('<robot name="r">\n<!--link name="a"/>\n</robot>', 2, "close the comment with -->"),
            ('<robot name="r">\n<!-- a -- b -->\n</robot>', 2, "a comment"),
            ('<robot name="r">\n<link name="a"type="b"/></robot>', 2, "a space"),
            ('\n<?xml version="1.0"?>\n<robot name="r"/>', 2, "before <?xml"),
        ]:
            if name == "r.xacro" and line != 3 and "--" not in text and "<?xml" not in text:
                continue  # as in a URDF
            if name == "r.urdf" and ("--" in text or "<?xml" in text or "&" in text):
                continue  # Gazebo's reader forgives these, that of xacro does not
            (finding,) = findings(text, name)
            assert (finding.rule, finding.severity) == ("file", "error")
            assert finding.place.line == line
            assert fix in str(finding)
            assert len(str(finding).splitlines()) == 2


def test_a_file_that_is_no_robot_is_one_finding(findings: Findings) -> None:
    for text in [
        "",
        "<world/>",
        '<robot name="r" xmlns:xacro="x"><link name="${1/0}"/></robot>',
        "<sdf><world/></sdf>",
        "<sdf/>",
    ]:
        (finding,) = findings(text, "r.xacro")
        assert finding.rule == "file"


def test_a_file_that_is_not_there_is_one_finding(tmp_path: Path) -> None:
    for path in (tmp_path / "nowhere.urdf", tmp_path, Path("a\0b")):
        (finding,) = check(path)[0]
        assert finding.rule == "file"


def test_letters_are_counted() -> None:
    rows = [
        ("", "", 0),
        ("limit", "dimit", 1),
        ("length", "lenght", 1),
        ("a", "abcd", 3),
        ("ab", "cd", 2),
    ]
    for one, other, far in rows:
        assert distance(one, other) == distance(other, one) == far


def test_a_known_word_is_found() -> None:
    for word, element, meant in [
        ("ivz", "inertia", True),
        ("raduis", "cylinder", "radius"),
        ("height", "cylinder", "length"),
        ("foo", "origin", None),
    ]:
        found = nearest(word, sorted(URDF[element].attributes))
        assert found == meant if meant is not True else found in ("ixz", "iyz", "izz")


def test_of_two_spellings_the_one_in_the_same_style_is_meant() -> None:
    assert nearest("comandTopic", PLUGIN, 6) == "commandTopic"
    assert nearest("comand_topic", PLUGIN, 6) == "command_topic"


def test_short_and_far_words_are_not_guessed_at() -> None:
    assert nearest("kp", ["kd"], 4) is None
    assert nearest("x" * 50, ["x" * 49]) is None


LONG = "x" * 300_000
MASS = (
    '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
    'iyz="0"/></inertial>'
)


def test_a_long_word_of_the_file_does_not_make_a_long_finding(tmp_path: Path) -> None:
    for parts in [
        f'<gazebo><plugin name="p" filename="{LONG}"/></gazebo>',
        f'<gazebo reference="{LONG}"/>',
        f'<gazebo reference="{"x " * 10_000}"/>',
        f'<link name="{LONG}"/>',
        f'<joint name="j" type="{LONG}"><parent link="a"/><child link="a"/></joint>',
        f'<joint name="j" type="fixed"><parent link="{LONG}"/><child link="a"/></joint>',
    ]:
        file = tmp_path / "robot.urdf"
        file.write_text(f'<robot name="r"><link name="a">{MASS}</link>{parts}</robot>')
        findings = check(file)[0]
        assert findings
        assert all(len(str(finding)) < 5000 for finding in findings)
