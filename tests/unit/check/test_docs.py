"""docs/check.md has the rules as they are."""

from holozen.check.report import RULES, table
from tests.unit.check.conftest import HERE


def test_the_table_of_the_rules_is_current() -> None:
    assert (HERE.parents[2] / "docs" / "check.md").read_text().endswith("\n\n" + table())


def test_each_rule_has_its_own_name() -> None:
    assert len({rule.name for rule in RULES}) == len(RULES)
