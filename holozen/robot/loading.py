"""Robot files -> a checked RobotModel, or a self-contained text. What is hostile in them is read in a process apart."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from xml.parsers import expat

from holozen.robot import reader
from holozen.robot.elements import Source, repair_xml
from holozen.robot.errors import RobotError
from holozen.robot.meshes import data_uri, file_uri
from holozen.robot.model import RobotModel
from holozen.robot.packages import is_data, readable, readable_by_strangers, resolve_uri
from holozen.robot.sdf_models import parse_sdf
from holozen.robot.sources import source_lines
from holozen.robot.urdf import read_robot
from holozen.robot.xacro import expanded, is_xacro, read_text
from holozen.suggest import cut


def load(
    path: Path,
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    strict: bool = False,
    allow_env: Collection[str] = (),
) -> RobotModel:
    """The robot in a xacro, URDF or SDF file. `args`, `packages` and `allow_env` as for `xacro.expand_xacro`. Raises
    RobotError; with `strict` also for a missing or invalid mesh, otherwise replaced by a box with a warning.
    """
    return _loaded(path, args, packages, strict, allow_env, portable=False)[0]


def both(
    path: Path, args: Mapping[str, str], packages: Mapping[str, Path], strict: bool, allow_env: Collection[str]
) -> tuple[RobotModel, str]:
    """As `load`, and the text, expanded, that is the same robot on another machine: the URI of every collision mesh is
    replaced by its hull, and of every visual one by the file itself, up to MOST_SHOWN. Other meshes have a warning.
    """
    return _loaded(path, args, packages, strict, allow_env, portable=True)


def _loaded(
    path: Path, args: Mapping[str, str], packages: Mapping[str, Path], strict: bool, allow_env: Collection[str],
    portable: bool,
) -> tuple[RobotModel, str]:  # fmt: skip
    text, place, warnings = _written(path, args, packages, allow_env)
    in_source = partial(_in_source, place, path, args, packages, allow_env)
    try:
        model, sent = reader.run(
            tuple[RobotModel, str], path, _parsed, text, path, packages, place, strict, portable,
            readable=partial(readable, path, packages),
        )  # fmt: skip
    except RobotError as error:
        raise RobotError(*in_source([str(error)])) from None
    return replace(model, warnings=warnings + in_source(model.warnings)), sent


def _parsed(
    text: str, path: Path, packages: Mapping[str, Path], place: str, strict: bool, portable: bool
) -> tuple[RobotModel, str]:
    model = parse(text, path, packages, place, strict)
    sent, warnings = with_meshes(text, path, packages) if portable else ("", ())
    return replace(model, warnings=model.warnings + warnings), sent


def received(text: str, packages: Mapping[str, Path] = {}) -> RobotModel:
    """The robot in a text that came over the network. Raises RobotError."""
    origin = Path("resource_string")
    known = partial(readable_by_strangers, packages)
    return reader.run(
        RobotModel, origin, partial(parse, confined=True), text, origin, packages,
        readable=known, only_known=True, seconds=MOST_SECONDS,
    )  # fmt: skip


def _written(
    path: Path, args: Mapping[str, str], packages: Mapping[str, Path], allow_env: Collection[str]
) -> tuple[str, str, tuple[str, ...]]:
    """The text of a file, expanded; how messages name it, and the warnings of its expansion."""
    text = read_text(path)
    if not is_xacro(path, text):
        return text, "", ()
    outcome = expanded(path, args, packages, allow_env)
    # Where the line in the source is not known, messages give that of the expanded text.
    return outcome.text, f"{path} (as `holozen xacro` prints it)", outcome.warnings


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


MOST_SECONDS = 3  # of the processor, for a text that was sent: the sim waits for it
MESHES = {"collision": ["collision", "geometry", "mesh"], "visual": ["visual", "geometry", "mesh"]}
MOST_SHOWN = 2_000_000  # characters of visual meshes in a text; a reader accepts MOST_TEXT in all

_FILENAME = re.compile(rb"""\sfilename\s*=\s*("[^"]*"|'[^']*')""")


def _in_source(
    place: str, path: Path, args: Mapping[str, str], packages: Mapping[str, Path], allow_env: Collection[str],
    messages: Sequence[str],
) -> tuple[str, ...]:  # fmt: skip
    """Messages about lines of the expanded text, which they call `place`, with the lines of the source instead."""
    start = f"{place}, line "
    if not place or not any(start in message for message in messages):
        return tuple(messages)
    lines = source_lines(path, args, packages, allow_env)

    def named(found: re.Match[str]) -> str:
        return lines.get(int(found[1]), found[0])

    return tuple(re.sub(rf"{re.escape(start)}(\d+)", named, message) for message in messages)


def with_meshes(text: str, path: Path, packages: Mapping[str, Path]) -> tuple[str, tuple[str, ...]]:
    """The text with its meshes in it, and warnings about visual ones that are too large or cannot be read."""
    text, _ = repair_xml(text)
    data = text.encode()
    warnings: list[str] = []
    room = MOST_SHOWN
    for use, start, end, uri in reversed(_Meshes(data).found):  # backwards, so that earlier positions stay valid
        try:
            file = resolve_uri(uri, path, packages)
        except RobotError:
            continue
        try:
            sent = data_uri(file) if use == "collision" else file_uri(file)
            if use == "visual" and (room := room - len(sent)) < 0:
                raise RobotError(f"the visual meshes take more than {MOST_SHOWN / 1e6:g} MB compressed; simplify them")
        except RobotError as error:
            if use == "visual":
                warnings.append(f"{path}: the visual mesh {cut(uri)} is not sent: {error}")
        else:
            data = data[:start] + sent.encode() + data[end:]
    return data.decode(), tuple(reversed(warnings))


class _Meshes:
    """The URIs of meshes in a text: their use (collision or visual), first byte, end byte, and the URI."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.found: list[tuple[str, int, int, str]] = []
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
        if (use := self._use(self._open)) and "filename" in attributes:
            match = _FILENAME.search(self.data, at)
            assert match is not None, "expat found the attribute"
            self._note(use, match.start(1) + 1, match.end(1) - 1, attributes["filename"])

    def _characters(self, text: str) -> None:
        self._text += text

    def _end(self, name: str) -> None:
        if self._open[-1] == "uri" and (use := self._use(self._open[:-1])):
            self._note(use, self._inside, self._parser.CurrentByteIndex, self._text)
        self._open.pop()

    def _use(self, names: list[str]) -> str:
        return next((use for use, ends in MESHES.items() if names[-3:] == ends), "")

    def _note(self, use: str, start: int, end: int, uri: str) -> None:
        if uri.strip() and not is_data(uri):
            self.found.append((use, start, end, uri.strip()))
