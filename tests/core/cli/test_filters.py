"""A filter is an expression over the fields of a message."""

import pytest

from holozen.fields import Filter, path, pick

MESSAGE = {
    "linear": {"x": 0.3, "y": 0},
    "name": ["a", "b"],
    "frame_id": "odom",
    "m": 5,
    "ok": True,
    "from": 1,
    "points": [{"x": 1}, {"x": 2}],
}


def test_a_true_expression_passes() -> None:
    for text in [
        "m.linear.x > 0.2",
        "linear.x > 0.2",
        " linear.x>.2 ",
        "0.1 < linear.x < 0.4",
        "linear.x >= 0.3 and not linear.y",
        "linear.y or linear.x",
        "'a' in name",
        "'c' not in name",
        "name[0] == 'a'",
        "m['from'] == 1",
        "len(name) == 2",
        "abs(-linear.x - 0.1) < 0.5",
        "frame_id != 'map'",
        "ok",
        "linear.x * 2 + 1 - 0.6 == 1",
        "7 // 2 % 2 == 1",
        "-1 < 0",
        "name == name",
        "linear.x / 3 < 1",
        "name[-1] == 'b'",
        "any(each > 'a' for each in m.name)",
        "frame_id.startswith('od')",
        "points[1].x == 2",
    ]:
        assert Filter(text).passes(MESSAGE) is True
        assert Filter(f"not ({text})").passes(MESSAGE) is False


def test_a_message_that_lacks_the_field_or_holds_something_else_does_not_pass() -> None:
    for text in [
        "angular.z > 0",
        "linear.z == 0",
        "linear > 1",
        "name[5] == 'a'",
        "1 / 0 == 1",
        "-frame_id",
        "len(3)",
        "m.linear.x.y > 0",
        "name['a']",
    ]:
        assert Filter(text).passes(MESSAGE) is False


def test_a_message_without_fields_does_not_pass() -> None:
    for message in ("text", [1, 2], None, 3.5):
        assert Filter("linear.x > 0").passes(message) is False


def test_what_is_no_expression_is_refused_in_one_line() -> None:
    for text in ["", " ", "linear.x >", "(", "a b", "import os", "x = 1", "\0"]:
        with pytest.raises(ValueError, match=r"^filter .*; write one such as m.linear.x > 0.2$"):
            Filter(text)


def test_a_field_is_picked_by_its_path() -> None:
    for text, value in {
        "linear.x": 0.3,
        "name": ["a", "b"],
        "name[1]": "b",
        "frame_id": "odom",
    }.items():
        assert pick(MESSAGE, path(text)) == value


def test_what_is_no_path_is_refused() -> None:
    for text in ["", ".", "..", "a.", ".a", "a..b", "a[", "a[x]", "a[-1]", "[", "a" * 501]:
        with pytest.raises(ValueError, match="is not a field; write names with dots"):
            path(text)


def test_a_missing_field_is_reported_with_the_existing_ones() -> None:
    for text, expected in [
        ("linaer.x", "no field 'linaer' (did you mean 'linear'?); there are linear, name"),
        ("linear.z", "no field 'z'; there are x, y"),
        ("name.a", "no field 'a' in a list; write [0]"),
        ("name[2]", "no [2]; the list has 2 values"),
        ("frame_id.x", "no field 'x' in a str"),
    ]:
        with pytest.raises(LookupError) as error:
            pick(MESSAGE, path(text))
        assert error.value.args[0].startswith(expected)
