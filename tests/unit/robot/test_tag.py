"""XML is read into elements that know their line, and a hostile text is refused at once."""

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.tag import DEEPEST, MOST_ELEMENTS, MOST_TEXT, Tag, read_xml


def refusal(text: str) -> str:
    with pytest.raises(RobotError) as error:
        read_xml(text, "f")
    told = str(error.value)
    assert "\n" not in told
    return told


def test_text_between_comments_and_elements_is_one_text() -> None:
    tag = read_xml("<a>1<!-- x -->2<b>inner</b>3<![CDATA[4]]>&lt;</a>", "f")
    assert tag.text == "1234<"
    assert tag.children[0].text == "inner"


def test_a_text_of_many_pieces_is_put_together() -> None:
    assert read_xml(f"<a>{'x<!---->' * 400_000}</a>", "f").text == "x" * 400_000


def test_too_much_text_is_refused_with_its_size_and_what_is_allowed() -> None:
    assert refusal("x" * (MOST_TEXT + 1)) == (
        "f: the file holds 4.0 MB of XML; a robot or world has at most 4 MB: put its meshes into files of their own"
    )
    assert "broken XML" in refusal("x" * MOST_TEXT)


def test_one_element_too_many_is_refused_before_the_rest_is_read() -> None:
    most = "<b/>" * (MOST_ELEMENTS - 1)
    assert len(read_xml(f"<a>{most}</a>", "f").children) == MOST_ELEMENTS - 1
    told = refusal(f"<a>{most}\n<b/> < broken")
    assert told == f"f, line 2: <b> is element number {MOST_ELEMENTS + 1}; a file holds at most {MOST_ELEMENTS}"


def test_elements_lie_two_hundred_deep_and_no_deeper() -> None:
    read_xml("<a>" * DEEPEST + "</a>" * DEEPEST, "f")
    told = refusal("<a>" * DEEPEST + "<b>" + "<c> < broken")
    assert told == f"f, line 1: <b> lies inside {DEEPEST} others; elements lie at most {DEEPEST} deep"


def test_a_value_is_the_attribute_or_else_the_text() -> None:
    assert Tag("a", {"value": " 1 "}, "f", text="2").value() == "1"
    assert Tag("a", {"value": ""}, "f", text=" 2\n").value() == "2"
