"""docs/cli.md has the verbs and flags as they are, and every verb shows an example."""

import re
from pathlib import Path

from holozen import cli
from scripts.table_of_verbs import table
from tests import present

PAGE = Path(__file__).parents[3] / "docs" / "cli.md"
VERBS = [
    (noun, verb)
    for noun in ("topic", "service", "node", "param")
    for verb in cli.command(noun).modules
]


def test_the_table_of_the_verbs_is_current() -> None:
    shown = (
        PAGE.read_text()
        .partition("<!-- table -->\n")[2]
        .partition("\n<!-- /table -->\n")[0]
        .splitlines()
    )
    left_out = [f"| `holozen {verb}" for verb in cli.VERBS if verb not in present.VERBS]
    rows = [
        row
        for row in shown
        if not any(re.match(rf"{re.escape(each)}[ `]", row) for each in left_out)
    ]
    assert table(present.VERBS).splitlines() == rows, "scripts/tables rewrites it"


def test_a_row_has_three_cells() -> None:
    assert {line.replace("\\|", "").count("|") for line in table(present.VERBS).splitlines()} == {4}


def test_a_verb_has_help_with_an_example_and_writes_json() -> None:
    for noun, verb in VERBS:
        reported = cli.command(noun).verb(verb).parser().format_help()
        assert reported.startswith(f"usage: holozen {noun} {verb} ")
        assert f"example: holozen {noun} {verb}" in reported
        assert "--json" in reported
