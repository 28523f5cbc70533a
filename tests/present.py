"""Which extensions, and so which verbs, are in this checkout: one that was left out takes its tests
with it.
"""

from pathlib import Path

import pytest

from holozen.cli import table

REPO = Path(__file__).parents[1]
EXTENSIONS = {path.parent.name for path in REPO.glob("extensions/*/__init__.py")}
NEEDS = {"view": {"bags"}}
"""Extension -> the others that it needs."""


def is_here(verb: str) -> bool:
    """Whether a verb can run: it is the core's, or its extension is there, with those that it
    needs.
    """
    name = table.VERBS[verb].package.removeprefix("holozen.")
    is_core = name == "cli" or (REPO / "services" / name).is_dir()
    return is_core or {name, *NEEDS.get(name, ())} <= EXTENSIONS


VERBS = [verb for verb in table.VERBS if is_here(verb)]


def needs(*verbs: str) -> pytest.MarkDecorator:
    """Skip a test of what a verb of an extension does, where that is left out."""
    lacking = [verb for verb in verbs if verb not in VERBS]
    return pytest.mark.skipif(bool(lacking), reason=f"left out: {', '.join(lacking)}")
