"""A robot file as one text that needs no other file: what a client sends to a sim on another machine."""

import re
from collections.abc import Mapping
from pathlib import Path
from xml.parsers import expat

from holozen.robot.errors import RobotError, cut
from holozen.robot.mesh.files import data_uri
from holozen.robot.tag import read_xml
from holozen.robot.uris import is_data, resolve_uri
from holozen.robot.xacro import expand

COLLISION = ["collision", "geometry", "mesh"]

_FILENAME = re.compile(rb"""\sfilename\s*=\s*("[^"]*"|'[^']*')""")


def portable(
    path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}
) -> tuple[str, tuple[str, ...]]:
    """The text of a xacro, URDF or SDF file, expanded, in which the hull of every collision mesh stands in place of the
    mesh's URI; and warnings for meshes that are left as they were. All else in the text is kept.

    `args` and `packages` are those of `xacro.expand`. Raises RobotError for a file that cannot be read or is no XML.
    """
    text = expand(path, args, packages)
    read_xml(text, str(path))  # tells broken XML with its line, and refuses entities
    data = text.encode()
    warnings: list[str] = []
    for start, end, uri in reversed(_Meshes(data).found):  # from the back, so that places stay where they are
        try:
            hull = data_uri(resolve_uri(uri, path, packages))
        except RobotError as error:
            warnings.append(f"{path}: the collision mesh {cut(uri)} is not sent: {error}")
        else:
            data = data[:start] + hull.encode() + data[end:]
    return data.decode(), tuple(reversed(warnings))


class _Meshes:
    """Where the URIs of collision meshes stand in a text: first byte, the one after the last, and the URI."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.found: list[tuple[int, int, str]] = []
        self._open: list[str] = []
        self._text, self._inside = "", 0
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.Parse(data, True)

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._open.append(name)
        self._text = ""
        at = self._parser.CurrentByteIndex
        self._inside = self.data.index(b">", at) + 1
        if self._open[-3:] == COLLISION and "filename" in attributes:
            match = _FILENAME.search(self.data, at)
            assert match is not None, "expat found the attribute"
            self._note(match.start(1) + 1, match.end(1) - 1, attributes["filename"])

    def _characters(self, text: str) -> None:
        self._text += text

    def _end(self, name: str) -> None:
        if self._open[-4:] == [*COLLISION, "uri"]:
            self._note(self._inside, self._parser.CurrentByteIndex, self._text)
        self._open.pop()

    def _note(self, start: int, end: int, uri: str) -> None:
        if uri.strip() and not is_data(uri):
            self.found.append((start, end, uri.strip()))
