"""docs/cli.md has the verbs and flags as they are, and every verb shows an example."""

from pathlib import Path

from holozen import cli
from scripts.table_of_verbs import table

PAGE = Path(__file__).parents[3] / "docs" / "cli.md"
VERBS = [(noun, verb) for noun in ("topic", "service", "node", "param") for verb in cli.command(noun).modules]


def test_the_table_of_the_verbs_is_current() -> None:
    assert f"<!-- table -->\n{table()}\n<!-- /table -->\n" in PAGE.read_text(), "scripts/tables rewrites it"


def test_a_row_has_three_cells() -> None:
    assert {line.replace("\\|", "").count("|") for line in table().splitlines()} == {4}


def test_a_verb_has_help_with_an_example_and_writes_json() -> None:
    for noun, verb in VERBS:
        reported = cli.command(noun).verb(verb).parser().format_help()
        assert reported.startswith(f"usage: holozen {noun} {verb} ")
        assert f"example: holozen {noun} {verb}" in reported
        assert "--json" in reported
