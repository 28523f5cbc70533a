"""Whatever is done to a robot file, findings come out and nothing else."""

import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.extensions.check.conftest import HERE, check_here

Trials = Callable[[int, int], int]
REPO = HERE.parents[2]
TOKEN = re.compile(r"""<[^<>]*>|[\w:.-]+\s*=\s*"[^"]*"|[\w.${}()-]+""")
WORDS = [
    "",
    "0",
    "-1",
    "nan",
    "1e308",
    "abc",
    "base",
    "<link/>",
    '<joint name="x" type="revolute"/>',
    "</link>",
    "&",
    '"',
]
FILES = [HERE / "good.urdf", HERE / "good.sdf"]


def mutations(text: str, seed: int, count: int) -> Iterator[str]:
    """The text with parts of it left out, doubled, swapped, replaced, or cut off; the same for one
    seed.
    """
    chance = random.Random(seed)
    for _ in range(count):
        changed = text
        for _ in range(chance.choice([1, 1, 2, 5])):
            changed = mutated(changed, chance)
        yield changed


def mutated(text: str, chance: random.Random) -> str:
    tokens = list(TOKEN.finditer(text))
    if not tokens or chance.random() < 0.05:
        return text[: chance.randrange(len(text) + 1)]
    one, other = chance.choice(tokens), chance.choice(tokens)
    piece = chance.choice(
        [
            "",
            one[0] * 2,
            other[0],
            chance.choice(WORDS),
            re.sub(r"[\d.]+", chance.choice(WORDS), one[0]),
        ]
    )
    return text[: one.start()] + piece + text[one.end() :]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_nothing_but_findings_comes_out(path: Path, tmp_path: Path, trials: Trials) -> None:
    text, broken, count = path.read_text(), 0, trials(60, 1000)
    for number, changed in enumerate(mutations(text, 4, count)):
        (tmp_path / path.name).write_text(changed)
        found = check_here(tmp_path / path.name)
        broken += bool(found)
        for finding in found:
            assert len(str(finding).splitlines()) == 2, (number, finding)
            assert finding.place.line <= changed.count("\n") + 1
    assert broken > count / 3


def test_nothing_but_findings_comes_out_of_xacro(tmp_path: Path, trials: Trials) -> None:
    text = (REPO / "urdf" / "hb_bot.urdf.xacro").read_text()
    for changed in mutations(text, 4, trials(3, 50)):
        (tmp_path / "r.xacro").write_text(changed)
        for finding in check_here(tmp_path / "r.xacro", packages={"holo": REPO}):
            assert len(str(finding).splitlines()) == 2, finding
