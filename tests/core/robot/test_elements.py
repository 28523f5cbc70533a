"""XML elements know their line; broken, hostile and huge texts are refused; warnings are kept in
order.
"""

from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import (
    DEEPEST,
    MAX_ATTRIBUTES,
    MAX_ELEMENTS,
    MAX_GUESSES,
    MAX_TEXT,
    MAX_WARNINGS,
    Source,
    Tag,
    read_xml,
    repair_xml,
)


def refusal(text: str) -> str:
    with pytest.raises(RobotError) as error:
        read_xml(text, "f")
    message = str(error.value)
    assert "\n" not in message
    return message


def test_text_between_comments_and_elements_is_one_text() -> None:
    tag = read_xml("<a>1<!-- x -->2<b>inner</b>3<![CDATA[4]]>&lt;</a>", "f")
    assert tag.text == "1234<"
    assert tag.children[0].text == "inner"


def test_a_text_of_many_pieces_is_put_together() -> None:
    assert read_xml(f"<a>{'x<!---->' * 400_000}</a>", "f").text == "x" * 400_000


def test_too_much_text_is_refused_with_its_size_and_what_is_allowed() -> None:
    assert refusal("x" * (MAX_TEXT + 1)) == (
        "f: the file contains 4.0 MB of XML; a robot or world has at most 4 MB: move its meshes "
        "to separate files"
    )
    assert "broken XML" in refusal("x" * MAX_TEXT)


def test_one_element_or_attribute_too_many_is_refused_before_the_rest_is_read() -> None:
    attributes = [f"a{number}=''" for number in range(MAX_ATTRIBUTES + 1)]
    assert len(read_xml(f"<a {' '.join(attributes[1:])}/>", "f").attributes) == MAX_ATTRIBUTES
    message = refusal(f"<a {' '.join(attributes)}> < broken")
    given = MAX_ATTRIBUTES + 1
    assert (
        message
        == f"f, line 1: <a> has {given} attributes; an element may have at most {MAX_ATTRIBUTES}"
    )
    most = "<b/>" * (MAX_ELEMENTS - 1)
    assert len(read_xml(f"<a>{most}</a>", "f").children) == MAX_ELEMENTS - 1
    message = refusal(f"<a>{most}\n<b/> < broken")
    assert (
        message == f"f, line 2: <b> is element number {MAX_ELEMENTS + 1}; a file may have at most "
        f"{MAX_ELEMENTS}"
    )


def test_elements_lie_two_hundred_deep_and_no_deeper() -> None:
    read_xml("<a>" * DEEPEST + "</a>" * DEEPEST, "f")
    message = refusal("<a>" * DEEPEST + "<b>" + "<c> < broken")
    assert (
        message == f"f, line 1: <b> lies inside {DEEPEST} others; elements may be nested at most "
        f"{DEEPEST} deep"
    )


def test_a_value_is_the_attribute_or_else_the_text() -> None:
    assert Tag("a", {"value": " 1 "}, "f", text="2").value() == "1"
    assert Tag("a", {"value": ""}, "f", text=" 2\n").value() == "2"


def test_more_warnings_than_anyone_reads_are_cut() -> None:
    source, tag = Source(Path("r.urdf"), {}), Tag("a", {}, "f, line 3")
    for index in range(MAX_WARNINGS + 5):
        source.warn(tag, f"is wrong {index}")
    assert len(source.warnings) == MAX_WARNINGS + 1
    assert source.warnings[0] == "f, line 3: <a> is wrong 0"
    assert (
        source.warnings[-1]
        == f"f, line 3: there are more than {MAX_WARNINGS} warnings; the rest are not listed"
    )


def test_the_nearest_name_is_reported_whatever_its_case() -> None:
    source = Source(Path("r.urdf"), {})
    assert source.suggest("chasis", ["wheel", "chassis"]) == " (did you mean 'chassis'?)"
    assert source.suggest("WHEEL", ["wheel", "chassis"]) == " (did you mean 'wheel'?)"
    assert source.suggest("xyz", ["wheel", "chassis"]) == ""


def test_what_names_have_in_common_makes_them_no_nearer() -> None:
    def own_name(kind: str) -> str:
        return kind.removeprefix("gazebo_ros_")

    source, known = Source(Path("r.urdf"), {}), ["gazebo_ros_imu", "gazebo_ros_planar_move"]
    assert source.suggest("gazebo_ros_foo", known) == " (did you mean 'gazebo_ros_imu'?)"
    assert source.suggest("gazebo_ros_foo", known, own_name, alike=0.8) == ""
    found = source.suggest("gazebo_ros_planarmove", known, own_name, alike=0.8)
    assert found == " (did you mean 'gazebo_ros_planar_move'?)"


def test_guessing_ends_in_a_file_of_nothing_but_mistakes() -> None:
    source = Source(Path("r.urdf"), {})
    message = [source.suggest("whel", ["wheel"]) for _ in range(MAX_GUESSES + 1)]
    assert message == [" (did you mean 'wheel'?)"] * MAX_GUESSES + [""]


HEADER = '<?xml version="1.0"?>'
FORGIVEN = {
    "header in the middle": (
        f'{HEADER}\n<robot name="r">\n{HEADER}\n<a/></robot>',
        3,
        "second <?xml",
    ),
    "header after a blank line": (
        f'\n{HEADER}\n<robot name="r"><a/></robot>',
        2,
        "white space before <?xml",
    ),
    "two dashes in a comment": (
        '<robot name="r">\n<!-- a -- b\n --- --><a/></robot>',
        2,
        "comment with --",
    ),
    "dashes at the end of a comment": (
        '<robot name="r">\n<!-- a ---><a/></robot>',
        2,
        "comment with --",
    ),
    "an attribute twice": (
        '<robot name="r"\n name="s" x="1"><a/></robot>',
        1,
        "attribute 'name' twice",
    ),
    "all of them": (
        f' {HEADER}\n<!-- -- --><robot name="r" name=">">\n<![CDATA[<?xml ?> -- '
        f"]]>{HEADER}<a/></robot>",
        1,
        "white space",
    ),
}


def test_what_gazebos_reader_forgives_is_read_with_a_warning() -> None:
    for what in FORGIVEN:
        text, line, problem = FORGIVEN[what]
        with pytest.raises(RobotError, match="broken XML"):
            read_xml(text, "f")
        source = Source(Path("f"), {})
        root = source.read(text)
        assert (root.name, root.attributes["name"], root.children[0].name) == ("robot", "r", "a")
        assert root.children[0].place == f"f, line {text[: text.index('<a/>')].count(chr(10)) + 1}"
        assert source.warnings[0].startswith(f"f, line {line}: ") and problem in source.warnings[0]
        assert len(source.warnings) == (4 if what == "all of them" else 1)


def test_other_broken_xml_is_refused_as_before() -> None:
    for text in [
        '<robot name="r">\n<a></robot>',
        "<robot><!-- a -- b",
        "<robot name=r/>",
        '<!DOCTYPE r [<!ENTITY e "x">]><robot><!-- -- -->&e;</robot>',
        "<!--" * 100_000,
        "<a '" * 100_000,
        "<robot><a " + 'x="1" ' * 100_000,
    ]:
        with pytest.raises(RobotError) as strict:
            read_xml(text, "f")
        with pytest.raises(RobotError) as lenient:
            Source(Path("f"), {}).read(text)
        assert str(lenient.value) == str(strict.value) or "entity" in str(lenient.value)


def test_good_xml_is_not_touched() -> None:
    text = '<?xml version="1.0"?>\n<robot a="x -- y"><!-- <?xml ?> --><b c="<!-- --"/></robot>'.replace(  # noqa: E501
        '"<!', '"&lt;!'
    )
    assert repair_xml(text) == (text, [])
