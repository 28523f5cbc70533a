"""JSON is read as the module json reads it, errors included."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen import plain_json

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(values, st.sampled_from([None, 1]), st.booleans(), st.sampled_from(["", " ", "\n\t \r"]))
def test_what_json_writes_is_read(value: Any, indent: int | None, ascii: bool, space: str) -> None:
    text = space + json.dumps(value, indent=indent, ensure_ascii=ascii) + space
    assert plain_json.loads(text) == json.loads(text) == value


@given(st.text(alphabet='{}[]",:0123456789.eE+-truefalsnN \n\\u'))
def test_anything_else_is_refused_in_the_same_words(text: str) -> None:
    def read(loads: Any) -> str:
        try:
            return repr(loads(text))
        except ValueError as error:
            return f"{type(error).__name__}: {error}"

    assert read(plain_json.loads) == read(json.loads)


def test_numbers_that_are_not_finite_are_read() -> None:
    first, *rest = plain_json.loads("[NaN, Infinity, -Infinity]")
    assert math.isnan(first)
    assert rest == [math.inf, -math.inf]


@pytest.mark.parametrize("text", ["", " ", "{", "1 2", "\ufeff1", "[1,]", '"\n"', "nul", "-", "\x0b1"])
def test_what_is_no_json_raises(text: str) -> None:
    with pytest.raises(json.JSONDecodeError):
        plain_json.loads(text)


def test_too_deep_is_too_deep() -> None:
    with pytest.raises(RecursionError):
        plain_json.loads("[" * 100_000)


def test_without_the_scanner_json_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plain_json, "_Ways", object)
    monkeypatch.setattr(plain_json, "_scan", plain_json._scanner())
    assert plain_json.loads(' {"a": [1]} ') == {"a": [1]}
