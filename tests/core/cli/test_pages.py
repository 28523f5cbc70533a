"""Each holozen command in the documentation is one that the command line takes, and is run or says
why not.
"""

import os
import re
import shlex

import pytest

from holozen import cli
from holozen.cli.verb import Noun, Service
from tests.pages import PAGES, READ, REPO, STEP
from tests.present import EXTENSIONS, VERBS

BLOCK = re.compile(
    r"^(`{3,})(?:|bash|sh|console|text)(?: title=.*)?\n(.*?)^\1$|((?:^    (?! ).*\n)+)", re.M | re.S
)
NOT_RUN = {  # how many blocks of a page
    "coming-from-ros": 1,
    "fleet": 4,
    "index": 1,
    "network": 1,
    "performance": 2,
    "real-robots": 5,
    "robot-files": 1,
    "ros2": 6,
    "security": 2,
    "testing": 1,
    "upstream": 4,
    "view": 1,
}
USAGE = re.compile(r"\[|\b[A-Z]{2,}\b=?\.\.\.|\.\.\.$")  # a form, not a command


def commands(page: str) -> list[str]:
    """The commands in its code blocks, without what a shell does with them."""
    found = []
    for block in BLOCK.finditer(page):
        text = (block[2] or block[3] or "").replace("\\\n", " ")
        for line in text.splitlines():
            line = re.sub(
                r"^(?:\$ )?(?:[A-Z_]+=\S+ |env |\w+=\S+ )*(?:\.venv/bin/)?", "", line.strip()
            )
            if line.startswith("holozen ") and not USAGE.search(line.partition(" #")[0]):
                found.append(re.split(r" (?:#|\||&|>|2>|</|&&|;)", f"{line} ")[0].rstrip(" &"))
    return found


def parse(line: str) -> None:
    """Parse a command as its verb does. SystemExit if it would be refused."""
    _, verb, *words = shlex.split(line)
    if verb in ("--help", "--version"):
        return
    assert verb in cli.VERBS, f"no verb {verb!r}"
    if verb not in VERBS:
        return  # its extension was left out
    command = cli.command(verb)
    if isinstance(command, Noun) and words and words[0] in command.modules:
        command = command.verb(words.pop(0))
    parser = command.module.parser() if isinstance(command, Service) else command.parser()
    if verb in ("run", "launch"):
        parser.parse_known_args(words)
    else:
        parser.parse_intermixed_args(words)


def test_commands_on_pages_are_taken(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(REPO)
    wrong, seen = [], 0
    for page in [REPO / "README.md", *PAGES]:
        for line in commands(page.read_text()):
            seen += 1
            try:
                parse(line)
            except (SystemExit, AssertionError) as error:
                reason = capsys.readouterr().err.strip() or str(error)
                if "there is no folder" not in reason:  # of an example
                    wrong.append(f"{os.path.relpath(page, REPO)}: {line}: {reason}")
    assert seen > 80
    assert wrong == []


def test_each_block_is_run_or_says_why_not() -> None:
    not_run = dict[str, int]()
    for page in PAGES:
        steps = list(STEP.finditer(page.read_text()))
        reasons = [step["reason"] for step in steps if step["reason"]]
        if reasons:
            not_run[page.stem if page.stem != "README" else page.parent.name] = len(reasons)
        left = STEP.sub(lambda step: step[0] if step["language"] in READ else "", page.read_text())
        assert commands(left) == [], f"{page.name}: neither run, nor a reason given"
        assert "```" not in STEP.sub("", left), f"{page.name}: a block that is no step"
        for test in re.findall(r"\btests/[\w/.]+", " ".join(reasons)):
            left_out = re.match(r"tests/extensions/(\w+)", test)
            assert (left_out and left_out[1] not in EXTENSIONS) or (REPO / test).exists(), (
                f"{page.name}: {test}"
            )
    assert not_run == NOT_RUN
