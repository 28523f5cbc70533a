"""A filter is a small expression over fields, and nothing else."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.cli.fields import LONGEST, MAX_NODES, compiled, path, pick

MESSAGE = {"linear": {"x": 0.3, "y": 0}, "name": ["a", "b"], "frame_id": "odom", "m": 5, "ok": True, "from": 1}


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
    ]:
        assert compiled(text)(MESSAGE) is True
        assert compiled(f"not ({text})")(MESSAGE) is False


def test_a_message_that_lacks_the_field_or_holds_something_else_does_not_pass() -> None:
    for text in [
        "angular.z > 0",
        "linear.z == 0",
        "linear > 1",
        "name[5] == 'a'",
        "1 / 0 == 1",
        "name + name",
        "frame_id * 3",
        "-frame_id",
        "len(3)",
        "m.linear.x.y > 0",
        "m.__class__",
        "name['a']",
    ]:
        assert compiled(text)(MESSAGE) is False


def test_a_message_without_fields_does_not_pass() -> None:
    for message in ("text", [1, 2], None, 3.5):
        assert compiled("linear.x > 0")(message) is False


def test_anything_else_is_refused_in_one_line() -> None:
    for text in [
        "",
        " ",
        "linear.x >",
        "(",
        "a b",
        "import os",
        "x = 1",
        "x := 1",
        "__import__('os').system('true')",
        "open('x')",
        "lambda: 1",
        "[x for x in name]",
        "{1: 2}",
        "[1]",
        "(1, 2)",
        "f'{m}'",
        "linear.x ** 9",
        "1 << 9",
        "~1",
        "+1",
        "b'a'",
        "name[0:1]",
        "a if b else c",
        "m.x()",
        "abs(1, 2)",
        "abs(x=1)",
        "len(*name)",
        "x is None",
        "...",
        "1j",
        "await x",
        "x" * (LONGEST + 1),
        "(" * 300 + "1" + ")" * 300,
        "1+" * (MAX_NODES // 2) + "1",
        "\0",
        "-" * 900 + "1",
    ]:
        with pytest.raises(ValueError) as error:
            compiled(text)
        assert str(error.value).startswith(("filter", "the filter"))


@given(st.text("m.xy[]()<>=!+-*/%'\"0123456789 andortilf,:{}@&|^~\\", max_size=40))
def test_no_text_does_more_than_pass_or_not(text: str) -> None:
    try:
        passes = compiled(text)
    except ValueError:
        return
    assert passes(MESSAGE) in (True, False)


def test_a_field_is_picked_by_its_path() -> None:
    for text, value in {"linear.x": 0.3, "name": ["a", "b"], "name[1]": "b", "frame_id": "odom"}.items():
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
