"""Robot files -> a checked RobotModel, or a self-contained text."""

import re
from collections.abc import Collection, Mapping
from pathlib import Path
from xml.parsers import expat

from holozen.robot.elements import Source, read_xml, repair_xml
from holozen.robot.errors import RobotError
from holozen.robot.meshes import data_uri
from holozen.robot.model import RobotModel
from holozen.robot.packages import is_data, resolve_uri
from holozen.robot.sdf_models import parse_sdf
from holozen.robot.urdf import read_robot
from holozen.robot.xacro import expand, is_xacro, read_text
from holozen.suggest import cut


def load(
    path: Path,
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    strict: bool = False,
    allow_env: Collection[str] = (),
) -> RobotModel:
    """The robot in a xacro, URDF or SDF file. `args`, `packages` and `allow_env` as for `xacro.expand`. Raises
    RobotError; with `strict` also for a missing or invalid mesh, otherwise replaced by a box with a warning.
    """
    text, place = read_text(path), ""
    if is_xacro(path, text):
        # Line numbers are those of the expanded text, so messages have to mention it.
        text, place = expand(path, args, packages, allow_env), f"{path} (as `holozen xacro` prints it)"
    return parse(text, path, packages, place, strict)


def parse(
    text: str,
    origin: Path,
    packages: Mapping[str, Path] = {},
    place: str = "",
    strict: bool = False,
    confined: bool = False,
) -> RobotModel:
    """The robot in a URDF or SDF text. `origin` is the file of the text: relative paths and packages are resolved
    from there, and messages name it, or `place` if given. `strict` as for `load`; `confined` is for text received
    over the network, which may only open files of known packages. Raises RobotError.
    """
    source = Source(origin, packages, strict=strict, confined=confined)
    tag = source.read(text, place)
    if tag.name == "sdf":
        return parse_sdf(tag, source)
    if tag.name != "robot":
        raise tag.wrong("is not a robot; a URDF file starts with <robot name=...>, an SDF file with <sdf version=...>")
    return read_robot(tag, source)


COLLISION = ["collision", "geometry", "mesh"]

_FILENAME = re.compile(rb"""\sfilename\s*=\s*("[^"]*"|'[^']*')""")


def portable(
    path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}, allow_env: Collection[str] = ()
) -> tuple[str, tuple[str, ...]]:
    """The text of a xacro, URDF or SDF file, expanded, with the URI of every collision mesh replaced by its hull; and
    warnings for meshes that are left unchanged. The rest of the text is unchanged.

    `args`, `packages` and `allow_env` are those of `xacro.expand`. Raises RobotError for a file that
    cannot be read or is not XML.
    """
    text, _ = repair_xml(expand(path, args, packages, allow_env))
    read_xml(text, str(path))  # reports broken XML with its line, and rejects entities
    data = text.encode()
    warnings: list[str] = []
    for start, end, uri in reversed(_Meshes(data).found):  # backwards, so that earlier positions stay valid
        try:
            hull = data_uri(resolve_uri(uri, path, packages))
        except RobotError as error:
            warnings.append(f"{path}: the collision mesh {cut(uri)} is not sent: {error}")
        else:
            data = data[:start] + hull.encode() + data[end:]
    return data.decode(), tuple(reversed(warnings))


class _Meshes:
    """The URIs of collision meshes in a text: first byte, end byte, and the URI."""

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
