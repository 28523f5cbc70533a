"""Messages are made shorter, and become rows of a table."""

import csv
import io

from holozen.output import csv_row as row
from holozen.output import cut

MESSAGE = {"name": "a long name", "values": list(range(10)), "inner": [{"deep": [1, 2, 3]}]}


def test_lists_and_texts_are_cut_to_a_length() -> None:
    assert cut(MESSAGE, 2) == {
        "name": "a ...",
        "values": [0, 1, "... 8 more"],
        "inner": [{"deep": [1, 2, "... 1 more"]}],
    }
    assert cut(MESSAGE, 100) == cut(MESSAGE) == MESSAGE


def test_lists_and_texts_are_left_out_with_their_length() -> None:
    assert cut(MESSAGE, arrays=False) == {
        "name": "a long name",
        "values": "<10 values>",
        "inner": "<1 values>",
    }
    assert cut({"a": "text"}, texts=False) == {"a": "<4 characters>"}


def test_a_message_becomes_a_row() -> None:
    for value, line in [
        ({"a": 1, "b": {"c": 2.5, "d": [True, None]}}, "1,2.5,true,null"),
        ("one, two", '"one, two"'),
        ('say "hi"', '"say ""hi"""'),
        ("two\nlines\x1b", "two\\nlines\\u001b"),
        (3.5, "3.5"),
        ({}, ""),
    ]:
        assert row(value) == line


def test_a_row_is_read_back_by_the_standard_library() -> None:
    (cells,) = csv.reader(io.StringIO(row({"a": 'x,"y"', "b": [1, 2], "c": ""})))
    assert cells == ['x,"y"', "1", "2", ""]
