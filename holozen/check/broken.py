"""A file that cannot be read: what is wrong with its line."""

import re
from pathlib import Path

from holozen.check.finding import Place
from holozen.robot.errors import RobotError
from holozen.robot.xacro import read_text

_CASES = (
    (re.compile("[\u2018-\u201f]"), "replace the curly quotes by straight ones"),
    (re.compile(r"&(?!#?\w+;)"), "write &amp; for &"),
    (re.compile(r"<!--(?:(?!-->).)*--(?!>)"), "a comment holds no -- before its end"),
    (re.compile(r"""\s[\w:.-]+\s*=\s*(?!["'\s])"""), 'put the value in quotes: name="value"'),
    (re.compile(r"""<[\w:.-]+(?:\s+[\w:.-]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s+([\w:.-]+)(?=\s+[\w:.-]+\s*=|\s*/?>)"""),
     'the word {0} stands alone: give it a value, {0}="...", or join it to its neighbour'),
    (re.compile(r"""=\s*(?:"[^"]*|'[^']*)$"""), "close the quotes"),
    (re.compile(r"""(?:"[^"]*"|'[^']*')[\w:.-]+\s*="""), "put a space between two attributes"),
    (re.compile(r"<\s+\w|<\d"), "no space and no digit may follow <"),
)  # fmt: skip


def mend(place: Place, reason: str) -> str:
    """How to mend a file that cannot be read; broken XML by the line that it is told at and the one before."""
    if "is a world" in reason:
        return "check takes a robot, or a single <model>"
    if "broken XML" not in reason:
        return "mend that, then the rest is checked"
    if "mismatched" in reason or "no element found" in reason:
        return "close each element, the inner one first: </name>, or /> at the end of its tag"
    if "declaration not at start" in reason:
        return "nothing, not even a space, may stand before <?xml"
    if "junk after" in reason:
        return "a file has one <robot> around all; take away what follows its end"
    lines = _lines(Path(place.file))
    for line in lines[max(0, place.line - 2) : place.line][::-1]:
        for pattern, told in _CASES:
            if match := pattern.search(line):
                return told.format(*match.groups())
    return 'write each element as <name attribute="value"> and close it'


def _lines(path: Path) -> list[str]:
    try:
        return read_text(path).splitlines()
    except RobotError:
        return []
