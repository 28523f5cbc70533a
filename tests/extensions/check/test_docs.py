"""docs/check.md and docs/rules.md have the rules as they are."""

from holozen.check.report import EVERY, page, table
from tests.extensions.check.conftest import HERE

DOCS = HERE.parents[2] / "docs"


def test_the_pages_of_the_rules_are_current() -> None:
    for name, text in (("check", table()), ("rules", page())):
        assert (
            f"<!-- rules -->\n{text.rstrip()}\n<!-- /rules -->\n"
            in (DOCS / f"{name}.md").read_text()
        ), "see scripts/tables"


def test_each_rule_has_its_own_name() -> None:
    assert len({rule.name for rule in EVERY}) == len(EVERY)
