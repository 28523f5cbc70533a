"""Corrections that need no judgement: misspelt names, and moments of inertia that follow from shape and mass."""

import re
from collections.abc import Iterable

from holozen.check.engine import Edit, Finding

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_INERTIA = re.compile(r"<inertia\b[^<>]*(?:/>|>\s*</inertia\s*>)")
_END = re.compile(r"\s*</inertial\s*>")

Span = tuple[int, int, str]  # from, to, and what is there instead


def correct(text: str, file: str, findings: Iterable[Finding]) -> tuple[str, list[Finding]]:
    """The source `text` of a file, corrected, and the findings that were. Those in other files, and in lines of the
    expanded text, are left alone.
    """
    own = [one for one in findings if one.edit and one.place.file == file and one.place.line and not one.place.expanded]
    done = []
    for finding in sorted(own, key=lambda one: one.place.line, reverse=True):
        plain = _COMMENT.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
        start = sum(len(line) for line in plain.splitlines(keepends=True)[: finding.place.line - 1])
        assert finding.edit
        if spans := _spans(plain, start, finding.edit):
            done.append(finding)
        for first, last, instead in reversed(spans):
            text = text[:first] + instead + text[last:]
    return text, done[::-1]


def _spans(text: str, start: int, edit: Edit) -> list[Span]:
    """What an edit changes in a text without comments; nothing where that is not sure."""
    if edit.kind == "attribute":
        found = re.compile(rf"(?<![\w:-]){re.escape(edit.old)}(?=\s*=)").search(text, start)
        return [(*found.span(), edit.new)] if found else []
    if edit.kind == "element":
        return _names(text, start, edit)
    begin, end = text.rfind("<link", 0, start + len("<link")), text.find("</link", start)
    if "${" in text[begin:end]:
        return []  # of a macro's links with different shapes, each has an inertia of its own
    if edit.old:
        found = _INERTIA.search(text, start, end)
        return [(*found.span(), edit.new)] if found else []
    if found := _END.search(text, start, end):
        space = found[0][: found[0].index("<")]
        return [(found.start(), found.start(), f"{space}{'  ' if space else ''}{edit.new}")]
    return []


def _names(text: str, start: int, edit: Edit) -> list[Span]:
    """The name in an element's start tag, and in its end tag."""
    tag = re.compile(rf"<(/?)({re.escape(edit.old)})(?![\w:.-])(?:[^<>\"']|\"[^\"]*\"|'[^']*')*?(/?)>")
    spans: list[Span] = []
    depth = 0
    for found in tag.finditer(text, start):
        is_end, is_empty = bool(found[1]), bool(found[3])
        depth -= is_end
        if (is_end and depth == 0) or not spans:
            spans.append((*found.span(2), edit.new))
        if depth == 0 and (is_end or is_empty):
            return spans
        depth += not is_end and not is_empty
    return []
