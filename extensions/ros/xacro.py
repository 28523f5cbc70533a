"""xacro: robot files are expanded as `holozen spawn` does, so that paths are mended and errors name
the line.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any
from xml.dom import minidom

from holozen.robot.errors import RobotError
from holozen.ros import descriptions

__all__ = ["XacroException", "parse", "process", "process_doc", "process_file"]


class XacroException(ValueError):
    """A file cannot be expanded. One line, with the file's line."""


def process_file(
    input_file_name: Any, *, mappings: Mapping[str, Any] | None = None, **_others: Any
) -> minidom.Document:
    """The robot in a file as an XML document; `mappings` are the values of its xacro:arg. Raises
    XacroException.
    """
    return _document(descriptions.expand, _path(input_file_name), mappings)


def process(
    input_file_name: Any, *, mappings: Mapping[str, Any] | None = None, **_others: Any
) -> str:
    """The robot in a file as a text. Raises XacroException."""
    return process_file(input_file_name, mappings=mappings).toprettyxml(indent="  ")


def parse(inp: IO[Any] | str | None, filename: Any = None) -> minidom.Document:
    """An open file, or that called `filename`, for `process_doc`. Raises XacroException."""
    path = _path(filename or getattr(inp, "name", None))
    document = _document(lambda path, _: descriptions.read(path), path, None)
    document._holozen_path = path  # type: ignore[attr-defined]
    return document


def process_doc(
    doc: minidom.Document, *, mappings: Mapping[str, Any] | None = None, **_others: Any
) -> None:
    """Expand a document of `parse` in place; changes to it since then are lost. Raises
    XacroException.
    """
    path = getattr(doc, "_holozen_path", None)
    if path is None:
        raise XacroException(
            "process_doc expands documents of xacro.parse(open(FILE)); write "
            "xacro.process_file(FILE)"
        )
    expanded: Any = process_file(path, mappings=mappings)
    for old in list(doc.childNodes):
        doc.removeChild(old)
    for new in expanded.childNodes:
        doc.appendChild(doc.importNode(new, True))


def _path(name: Any) -> Path:
    if not isinstance(name, str | os.PathLike):
        raise TypeError(
            f"xacro needs the path of a file, not {name!r:.80}; a substitution has none before it "
            "is executed"
        )
    return Path(name)


def _document(expand: Any, path: Path, mappings: Mapping[str, Any] | None) -> minidom.Document:
    try:
        text = expand(path, {str(name): str(value) for name, value in (mappings or {}).items()})
    except RobotError as error:
        raise XacroException(str(error)) from None
    document = minidom.parseString(text.encode("utf-8", "surrogateescape"))
    _remove_indentation(document)
    return document


def _remove_indentation(node: Any) -> None:
    """As in the library's documents, which are indented only when they are written."""
    for child in list(node.childNodes):
        if child.nodeType == child.TEXT_NODE and not child.data.strip():
            node.removeChild(child)
        else:
            _remove_indentation(child)
