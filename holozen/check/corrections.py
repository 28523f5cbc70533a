"""Corrections that need no judgement: misspelt names, and moments of inertia that follow from shape and mass."""

import re
from bisect import bisect
from collections.abc import Iterable
from dataclasses import dataclass, field

from holozen.check.engine import Edit, Finding

_TOKEN = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"  # what is in these is no element
    r"|<(?P<end>/?)(?P<name>[^\s<>/=\"'!?]+)(?P<rest>(?:[^<>\"']|\"[^\"]*\"|'[^']*')*?)(?P<empty>/?)>",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"([^\s=<>\"']+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_COMPUTED = re.compile(r"\$[{(]|<xacro:")
_LINE_END = re.compile(r"\r\n?|\n")  # those of XML; str.splitlines knows more

Span = tuple[int, int, str]  # from, to, and what is there instead


@dataclass(eq=False, slots=True)
class _Element:
    """An element of the text, by offsets: `names` are where its name is, in the start tag and in the end tag."""

    name: str
    line: int
    parent: "_Element | None"
    attributes: dict[str, re.Match[str]]
    names: list[tuple[int, int]]
    start: int
    inside: int  # where its content begins,
    close: int  # and ends
    end: int
    children: list["_Element"] = field(default_factory=list)


def correct(text: str, file: str, findings: Iterable[Finding]) -> tuple[str, list[Finding]]:
    """The source `text` of a file, corrected, and the findings that were. Findings in other
    files or in lines of the expanded text, and ambiguous ones, are left alone.
    """
    own = [one for one in findings if one.edit and one.place.file == file and one.place.line and not one.place.expanded]
    elements = _elements(text) if own else []
    spans: set[Span] = set()
    done = []
    for finding in sorted(own, key=lambda one: bool(one.edit and one.edit.kind == "inertia")):  # names come first
        assert finding.edit
        wanted = set(_spans(text, [one for one in elements if one.line == finding.place.line], finding.edit))
        if wanted and not any(a < d and c < b for a, b, _ in wanted for c, d, _ in spans - wanted):
            spans |= wanted
            done.append(finding)
    for first, last, instead in sorted(spans, reverse=True):
        text = text[:first] + instead + text[last:]
    return text, sorted(done, key=lambda one: one.place.line)


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
        attributes = {one[1]: one for one in _ATTRIBUTE.finditer(text, *token.span("rest"))}
        parent = around[-1] if around else None
        place = bisect(lines, start) + 1, parent, attributes, [token.span("name")]
        found.append(_Element(token["name"], *place, start, end, end, end))
        if parent:
            parent.children.append(found[-1])
        if not token["empty"]:
            around.append(found[-1])
    return found


def _spans(text: str, here: list[_Element], edit: Edit) -> list[Span]:
    """What an edit changes, in the elements of its line; nothing where that is not sure."""
    if edit.kind == "element":
        return [(*span, edit.new) for one in here if one.name == edit.old for span in one.names]
    if edit.kind == "attribute":
        owners = [one.attributes for one in here if one.name == edit.owner and edit.new not in one.attributes]
        return [(*given[edit.old].span(1), edit.new) for given in owners if edit.old in given]
    inertials = [one.parent if edit.old else one for one in here if one.name == ("inertia" if edit.old else "inertial")]
    return [span for one in inertials if one and _belongs(text, one, edit.owner) for span in _moments(text, one, edit)]


def _belongs(text: str, inertial: _Element, link: str) -> bool:
    """Whether it is written in the link of this name, and nothing there is computed: a macro's may be in several
    links, which have different shapes.
    """
    owner = inertial.parent
    if inertial.name != "inertial" or owner is None or owner.name != "link" or "name" not in owner.attributes:
        return False
    given = owner.attributes["name"]
    return (given[2] or given[3] or "") == link and not _COMPUTED.search(text, owner.start, owner.end)


def _moments(text: str, inertial: _Element, edit: Edit) -> list[Span]:
    """The new <inertia>, instead of the one that is there unless that has more than attributes, or as the last."""
    there = [one for one in inertial.children if one.name == "inertia"]
    if there:
        empty = len(there) == 1 and not text[there[0].inside : there[0].close].strip()
        return [(there[0].start, there[0].end, edit.new)] if edit.old and empty else []
    content = text[inertial.inside : inertial.close]
    space = content[len(content.rstrip()) :]
    at = inertial.close - len(space)
    return [] if edit.old else [(at, at, f"{space}{'  ' if space else ''}{edit.new}")]
