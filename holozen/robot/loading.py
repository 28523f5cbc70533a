"""Robot files -> a checked RobotModel, or a self-contained text. Files are parsed in a process of their own."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from msgspec.structs import replace

from holozen.robot import reader
from holozen.robot.elements import Source, Tag, read_text, read_xml, repair_xml
from holozen.robot.errors import RobotError
from holozen.robot.meshes import data_uri, file_uri
from holozen.robot.model import RobotModel
from holozen.robot.packages import is_data, readable, readable_by_strangers, resolve_uri
from holozen.robot.sdf_models import parse_sdf
from holozen.robot.sources import source_lines
from holozen.robot.urdf import read_robot
from holozen.robot.xacro import XacroFile, expanded, is_xacro, unasked
from holozen.suggest import cut


def load(
    path: Path, args: Mapping[str, str] = {}, packages: Mapping[str, Path] = {}, allow_env: Collection[str] = ()
) -> RobotModel:
    """The robot in a xacro, URDF or SDF file. The arguments are those of XacroFile. A missing or invalid mesh is
    replaced by a box, with a warning. Raises RobotError.
    """
    return _loaded(XacroFile(path, args, packages, allow_env), strict=False, portable=False)[0]


def both(
    path: Path, args: Mapping[str, str], packages: Mapping[str, Path], strict: bool, allow_env: Collection[str]
) -> tuple[RobotModel, str]:
    """As `load`, and the robot's expanded text, from which another machine reads the same robot: its meshes are
    embedded, see `with_meshes`. With `strict` a missing or invalid mesh is an error.
    """
    return _loaded(XacroFile(path, args, packages, allow_env), strict, portable=True)


def _loaded(file: XacroFile, strict: bool, portable: bool) -> tuple[RobotModel, str]:
    path, packages = file.path, file.packages
    text, place, warnings = _written(file)
    try:
        model, portable_text = reader.run(
            tuple[RobotModel, str], path, _parsed, text, path, packages, place, strict, portable,
            readable=partial(readable, path, packages),
        )  # fmt: skip
    except RobotError as error:
        raise RobotError(*_in_source(place, file, [str(error)], calls=True)) from None
    return replace(model, warnings=warnings + _in_source(place, file, model.warnings)), portable_text


def _parsed(
    text: str, path: Path, packages: Mapping[str, Path], place: str, strict: bool, portable: bool
) -> tuple[RobotModel, str]:
    model = parse(text, path, packages, place, strict)
    portable_text, warnings = with_meshes(text, path, packages) if portable else ("", ())
    return replace(model, warnings=model.warnings + warnings), portable_text


def received(text: str, packages: Mapping[str, Path] = {}) -> RobotModel:
    """The robot in a text received over the network. `packages` are those it may read files of. Raises RobotError."""
    origin = Path("resource_string")
    known = partial(readable_by_strangers, packages)
    return reader.run(
        RobotModel, origin, partial(parse, confined=True), text, origin, packages,
        readable=known, only_known=True, seconds=MAX_SECONDS,
    )  # fmt: skip


def _written(file: XacroFile) -> tuple[str, str, tuple[str, ...]]:
    """The text of a file, expanded; the name of the expanded text in messages; and the warnings of the expansion."""
    text = read_text(file.path)
    if not is_xacro(file.path, text):
        return text, "", unasked(file.path, file.args)
    outcome = expanded(file)
    # Messages give the line of the expanded text where that of the source is unknown.
    return outcome.text, f"{file.path} (as `holozen xacro` prints it)", outcome.warnings


def parse(
    text: str,
    origin: Path,
    packages: Mapping[str, Path] = {},
    place: str = "",
    strict: bool = False,
    confined: bool = False,
) -> RobotModel:
    """The robot in a URDF or SDF text. `origin` is the file of the text: relative paths and packages are resolved
    from there, and messages name it, or `place` if given. `strict` as for `both`; `confined` is for text received
    over the network, which may only open files of known packages. Raises RobotError.
    """
    source = Source(origin, packages, strict=strict, confined=confined)
    tag = source.read(text, place)
    if tag.name == "sdf":
        return parse_sdf(tag, source)
    if tag.name != "robot":
        raise tag.wrong("is not a robot; a URDF file starts with <robot name=...>, an SDF file with <sdf version=...>")
    return read_robot(tag, source)


MAX_SECONDS = 3  # s of processor time for a text received over the network: the sim waits for it
USES = ("collision", "visual")
MAX_SHOWN = 2_000_000  # characters of visual meshes in a text; a reader accepts MAX_TEXT characters in all

_FILENAME = re.compile(rb"""\sfilename\s*=\s*("[^"]*"|'[^']*')""")


def _in_source(place: str, file: XacroFile, messages: Sequence[str], calls: bool = False) -> tuple[str, ...]:
    """The messages, with each line of the expanded text (`place`) replaced by the source line that it comes from, and
    with the `calls` of macros there.
    """
    start = f"{place}, line "
    if not place or not any(start in message for message in messages):
        return tuple(messages)
    lines = source_lines(file)

    def named(found: re.Match[str]) -> str:
        return lines[int(found[1])][0] if int(found[1]) in lines else found[0]

    pattern = re.compile(rf"{re.escape(start)}(\d+)")
    made = [[lines.get(int(line), ("", ""))[1] for line in pattern.findall(text)] if calls else [] for text in messages]
    return tuple(pattern.sub(named, text) + "".join(parts) for text, parts in zip(messages, made, strict=True))


def with_meshes(text: str, path: Path, packages: Mapping[str, Path]) -> tuple[str, tuple[str, ...]]:
    """The text with its meshes embedded as `data:` URIs, and warnings about those that are not: of a collision mesh the
    convex hull, of a visual mesh the file itself, up to MAX_SHOWN characters in all.
    """
    text, _ = repair_xml(text)
    data = text.encode()
    warnings: list[str] = []
    room = MAX_SHOWN
    for use, start, end, uri in reversed([*_meshes(read_xml(text, str(path)), data)]):  # so earlier offsets stay valid
        if not uri.strip() or is_data(uri):
            continue
        try:
            file = resolve_uri(uri := uri.strip(), path, packages)
        except RobotError:
            continue
        try:
            sent = data_uri(file) if use == "collision" else file_uri(file)
            if use == "visual" and (room := room - len(sent)) < 0:
                raise RobotError(f"the visual meshes take more than {MAX_SHOWN / 1e6:g} MB compressed; simplify them")
        except RobotError as error:
            if use == "visual":
                warnings.append(f"{path}: the visual mesh {cut(uri)} is not sent: {error}")
        else:
            data = data[:start] + sent.encode() + data[end:]
    return data.decode(), tuple(reversed(warnings))


def _meshes(root: Tag, data: bytes) -> Iterator[tuple[str, int, int, str]]:
    """The URI of each mesh in a text: its use (collision or visual), its first byte and its end, and the URI itself."""
    for mesh in root.below("mesh"):
        use = mesh.parent.parent.name if mesh.parent and mesh.parent.parent and mesh.parent.name == "geometry" else ""
        if use not in USES:
            continue
        if "filename" in mesh.attributes and (match := _FILENAME.search(data, mesh.at)):
            yield use, match.start(1) + 1, match.end(1) - 1, mesh.attributes["filename"]
        for tag in mesh.all("uri"):
            start = data.index(b">", tag.at) + 1
            yield use, start, data.index(b"</", start), tag.text
