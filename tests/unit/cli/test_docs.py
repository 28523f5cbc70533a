"""docs/cli.md has the verbs and flags as they are, and every verb shows an example."""

from pathlib import Path

import pytest

from holozen.cli import node, service, topic
from holozen.cli.noun import Noun
from holozen.cli.table import table

PAGE = Path(__file__).parents[3] / "docs" / "cli.md"
VERBS = [(noun, verb) for noun in (topic.NOUN, service.NOUN, node.NOUN) for verb in noun.modules]


def test_the_table_of_the_verbs_is_current() -> None:
    assert PAGE.read_text().endswith("<!-- table -->\n" + table()), "scripts/cli-table writes it anew"


def test_a_row_has_three_cells() -> None:
    assert {line.replace("\\|", "").count("|") for line in table().splitlines()} == {4}


@pytest.mark.parametrize(("noun", "verb"), VERBS, ids=lambda value: value if isinstance(value, str) else value.name)
def test_a_verb_has_help_with_an_example_and_writes_json(noun: Noun, verb: str) -> None:
    told = noun.one(verb).format_help()
    assert told.startswith(f"usage: holozen {noun.name} {verb} ")
    assert f"example: holozen {noun.name} {verb}" in told
    assert "--json" in told
