"""Corrections that need no judgement: misspelt names, and moments of inertia that follow from shape
and mass.
"""

import re
from bisect import bisect
from collections.abc import Iterable

from msgspec import Struct

from holozen.check.mistake import Edit, Finding

_TOKEN = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"  # there are no elements in these
    r"|<(?P<end>/?)(?P<name>[^\s<>/=\"'!?]+)(?P<rest>(?:[^<>\"']|\"[^\"]*\"|'[^']*')*?)(?P<empty>/?)>",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"([^\s=<>\"']+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_COMPUTED = re.compile(r"\$[{(]|<xacro:")
_LINE_END = re.compile(r"\r\n?|\n")  # those of XML; str.splitlines knows more

Span = tuple[int, int, str]
"""A part of the text, by its first and its end offset, and its replacement."""


class _Element(Struct, eq=False):
    """An element of the text, by offsets. `names` are the spans of its name in the start tag and
    the end tag, `inside` to `close` is its content.
    """

    name: str
    line: int
    parent: "_Element | None"
    attributes: dict[str, re.Match[str]]
    names: list[tuple[int, int]]
    start: int
    inside: int
    close: int
    end: int
    children: list["_Element"] = []


def correct(text: str, file: str, findings: Iterable[Finding]) -> tuple[str, list[Finding]]:
    """The source `text` of a file, corrected, and the findings that this corrects. Ambiguous
    findings, and those in other files or in lines of the expanded text, are left alone.
    """
    edits = [
        (each, each.edit)
        for each in findings
        if each.edit and each.place.file == file and each.place.line and not each.place.expanded
    ]
    elements = _elements(text) if edits else []
    spans: set[Span] = set()
    done = []
    for finding, edit in sorted(edits, key=lambda pair: pair[1].kind == "inertia"):  # names first
        new = set(
            _spans(
                text, [element for element in elements if element.line == finding.place.line], edit
            )
        )
        if new and not any(a < d and c < b for a, b, _ in new for c, d, _ in spans - new):
            spans |= new
            done.append(finding)
    for first, last, replacement in sorted(spans, reverse=True):
        text = text[:first] + replacement + text[last:]
    return text, sorted(done, key=lambda finding: finding.place.line)


def _elements(text: str) -> list[_Element]:
    """The elements of a text, in the order of their start tags."""
    lines = [found.end() for found in _LINE_END.finditer(text)]
    found: list[_Element] = []
    around: list[_Element] = []
    for token in _TOKEN.finditer(text):
        start, end = token.span()
        if token["name"] is None:
            continue
        if token["end"]:
            if around and around[-1].name == token["name"]:
                element = around.pop()
                element.close, element.end = start, end
                element.names.append(token.span("name"))
            continue
        attributes = {match[1]: match for match in _ATTRIBUTE.finditer(text, *token.span("rest"))}
        parent = around[-1] if around else None
        place = bisect(lines, start) + 1, parent, attributes, [token.span("name")]
        found.append(_Element(token["name"], *place, start, end, end, end))
        if parent:
            parent.children.append(found[-1])
        if not token["empty"]:
            around.append(found[-1])
    return found


def _spans(text: str, here: list[_Element], edit: Edit) -> list[Span]:
    """The changes of an edit, given the elements `here` on its line; none if it is not certain
    where they belong.
    """
    if edit.kind == "element":
        return [
            (*span, edit.new)
            for element in here
            if element.name == edit.old
            for span in element.names
        ]
    if edit.kind == "attribute":
        owners = [
            each.attributes
            for each in here
            if each.name == edit.owner and edit.new not in each.attributes
        ]
        return [(*given[edit.old].span(1), edit.new) for given in owners if edit.old in given]
    name = "inertia" if edit.old else "inertial"
    inertials = [
        element.parent if edit.old else element for element in here if element.name == name
    ]
    certain = [
        inertial for inertial in inertials if inertial and _belongs(text, inertial, edit.owner)
    ]
    return [span for inertial in certain for span in _moments(text, inertial, edit)]


def _belongs(text: str, inertial: _Element, link: str) -> bool:
    """Whether an <inertial> is written in the link of this name, and nothing in that link is
    computed: a macro may make several links of it, which have different shapes.
    """
    owner = inertial.parent
    if (
        inertial.name != "inertial"
        or owner is None
        or owner.name != "link"
        or "name" not in owner.attributes
    ):
        return False
    given = owner.attributes["name"]
    return (given[2] or given[3] or "") == link and not _COMPUTED.search(
        text, owner.start, owner.end
    )


def _moments(text: str, inertial: _Element, edit: Edit) -> list[Span]:
    """The new <inertia>, which replaces the old one or is added at the end; nothing if there are
    several, or if the old one has content.
    """
    old = [child for child in inertial.children if child.name == "inertia"]
    if old:
        is_plain = len(old) == 1 and not text[old[0].inside : old[0].close].strip()
        return [(old[0].start, old[0].end, edit.new)] if edit.old and is_plain else []
    content = text[inertial.inside : inertial.close]
    space = content[len(content.rstrip()) :]
    at = inertial.close - len(space)
    return [] if edit.old else [(at, at, f"{space}{'  ' if space else ''}{edit.new}")]
