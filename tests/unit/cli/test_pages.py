"""Each holozen command in the documentation is one that the command line takes."""

import os
import re
import shlex
from pathlib import Path

import pytest

from holozen import cli
from holozen.cli.verb import Noun, Service

REPO = Path(__file__).parents[3]
BLOCK = re.compile(r"^(`{3,})(?:|bash|sh|console|text)(?: title=.*)?\n(.*?)^\1$|((?:^    (?! ).*\n)+)", re.M | re.S)
USAGE = re.compile(r"\[|\b[A-Z]{2,}\b=?\.\.\.|\.\.\.$")  # a form, not a command


def commands(page: Path) -> list[str]:
    """The commands in its code blocks, without what a shell does with them."""
    found = []
    for block in BLOCK.finditer(page.read_text()):
        text = (block[2] or block[3] or "").replace("\\\n", " ")
        for line in text.splitlines():
            line = re.sub(r"^(?:\$ )?(?:[A-Z_]+=\S+ |env |\w+=\S+ )*(?:\.venv/bin/)?", "", line.strip())
            if line.startswith("holozen ") and not USAGE.search(line.partition(" #")[0]):
                found.append(re.split(r" (?:#|\||&|>|2>|</|&&|;)", f"{line} ")[0].rstrip(" &"))
    return found


def parse(line: str) -> None:
    """Parse a command as its verb does. SystemExit if it would be refused."""
    _, verb, *words = shlex.split(line)
    if verb in ("--help", "--version"):
        return
    assert verb in cli.VERBS, f"no verb {verb!r}"
    command = cli.command(verb)
    if isinstance(command, Noun) and words and words[0] in command.modules:
        command = command.verb(words.pop(0))
    parser = command.module.parser() if isinstance(command, Service) else command.parser()
    if verb in ("run", "launch"):
        parser.parse_known_args(words)
    else:
        parser.parse_intermixed_args(words)


def test_commands_on_pages_are_taken(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(REPO)
    wrong, seen = [], 0
    for page in [REPO / "README.md", *REPO.glob("docs/**/*.md")]:
        for line in commands(page):
            seen += 1
            try:
                parse(line)
            except (SystemExit, AssertionError) as error:
                reason = capsys.readouterr().err.strip() or str(error)
                if "there is no folder" not in reason:  # of an example
                    wrong.append(f"{os.path.relpath(page, REPO)}: {line}: {reason}")
    assert seen > 80
    assert wrong == []
