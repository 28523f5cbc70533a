"""Robot files -> a checked RobotModel, or a self-contained text. Files are parsed in a process of
their own.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files import reader
from holozen.robot.files.elements import Source, Tag, again, read_text, read_xml, repair_xml
from holozen.robot.files.meshes import data_uri, file_uri, triangles_uri
from holozen.robot.files.sdf_models import parse_sdf
from holozen.robot.files.sources import source_lines
from holozen.robot.files.textures import mesh_uri, texture_of
from holozen.robot.files.urdf import is_static, read_robot
from holozen.robot.files.uris import is_data, readable, readable_by_strangers, resolve_uri
from holozen.robot.files.xacro import XacroFile, expanded, is_xacro, unasked
from holozen.robot.model import RobotModel
from holozen.suggest import cut


def load(
    path: Path,
    args: Mapping[str, str] = {},
    packages: Mapping[str, Path] = {},
    allow_env: Collection[str] = (),
) -> RobotModel:
    """The robot in a xacro, URDF or SDF file. The arguments are those of XacroFile. A missing or
    invalid mesh is replaced by a box, with a warning. Raises RobotError.
    """
    return _loaded(XacroFile(path, args, packages, allow_env), strict=False, portable=False)[0]


def both(
    path: Path,
    args: Mapping[str, str],
    packages: Mapping[str, Path],
    strict: bool,
    allow_env: Collection[str],
) -> tuple[RobotModel, str]:
    """As `load`, and the robot's expanded text, from which another machine reads the same robot:
    its meshes are embedded, see `with_meshes`. With `strict` a missing or invalid mesh is an error.
    """
    return _loaded(XacroFile(path, args, packages, allow_env), strict, portable=True)


def _loaded(file: XacroFile, strict: bool, portable: bool) -> tuple[RobotModel, str]:
    path, packages = file.path, file.packages
    text, place, warnings = _written(file)
    try:
        model, portable_text = reader.run(
            tuple[RobotModel, str],
            path,
            _parsed,
            text,
            path,
            packages,
            place,
            strict,
            portable,
            readable=partial(readable, path, packages),
        )
    except RobotError as error:
        raise RobotError(*_in_source(place, file, [str(error)], calls=True)) from None
    return replace(
        model, warnings=warnings + _in_source(place, file, model.warnings)
    ), portable_text


def _parsed(
    text: str, path: Path, packages: Mapping[str, Path], place: str, strict: bool, portable: bool
) -> tuple[RobotModel, str]:
    model = parse(text, path, packages, place, strict)
    portable_text, warnings = with_meshes(text, path, packages) if portable else ("", ())
    return replace(model, warnings=model.warnings + warnings), portable_text


def received(text: str, packages: Mapping[str, Path] = {}) -> RobotModel:
    """The robot in a text received over the network. `packages` are those it may read files of.
    Raises RobotError.
    """
    origin = Path("resource_string")
    known = partial(readable_by_strangers, packages)
    return reader.run(
        RobotModel,
        origin,
        partial(parse, confined=True),
        text,
        origin,
        packages,
        readable=known,
        only_known=True,
        seconds=MAX_SECONDS,
    )


def _written(file: XacroFile) -> tuple[str, str, tuple[str, ...]]:
    """The text of a file, expanded; the name of the expanded text in messages; and the warnings of
    the expansion.
    """
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
    """The robot in a URDF or SDF text. `origin` is the file of the text: relative paths and
    packages are resolved from there, and messages name it, or `place` if given. `strict` as for
    `both`; `confined` is for text received over the network, which may only open files of known
    packages. Raises RobotError.
    """
    source = Source(origin, packages, strict=strict, confined=confined)
    tag = source.read(text, place)
    if tag.name == "sdf":
        return parse_sdf(tag, source)
    if tag.name != "robot":
        raise tag.wrong(
            "is not a robot; a URDF file starts with <robot name=...>, an SDF file with <sdf "
            "version=...>"
        )
    return read_robot(tag, source)


MAX_SECONDS = 3  # s of processor time for a text received over the network: the sim waits for it
USES = ("collision", "visual")
# characters of visual meshes in a text; a reader accepts MAX_TEXT characters in all
MAX_SHOWN = 2_000_000

_FILENAME = re.compile(rb"""\sfilename\s*=\s*("[^"]*"|'[^']*')""")


def _in_source(
    place: str, file: XacroFile, messages: Sequence[str], calls: bool = False
) -> tuple[str, ...]:
    """The messages, with each line of the expanded text (`place`) replaced by the source line that
    it comes from, and with the `calls` of macros there.
    """
    start = f"{place}, line "
    if not place or not any(start in message for message in messages):
        return tuple(messages)
    lines = source_lines(file)

    def named(found: re.Match[str]) -> str:
        return lines[int(found[1])][0] if int(found[1]) in lines else found[0]

    pattern = re.compile(rf"{re.escape(start)}(\d+)")
    made = [
        [lines.get(int(line), ("", ""))[1] for line in pattern.findall(text)] if calls else []
        for text in messages
    ]
    return tuple(
        pattern.sub(named, text) + "".join(parts)
        for text, parts in zip(messages, made, strict=True)
    )


def with_meshes(text: str, path: Path, packages: Mapping[str, Path]) -> tuple[str, tuple[str, ...]]:
    """The text with its meshes and images embedded as `data:` URIs, equal ones once, and a warning
    that names those that are not: of a collision mesh the convex hull, of a visual mesh the file
    itself, up to MAX_SHOWN characters of these and of images in all.
    """
    text, _ = repair_xml(text)
    data, source = text.encode(), Source(path, packages)
    replaced = list[tuple[int, int, str]]()
    hulls = list[str]()
    unsent, room, sent_before = dict[str, str](), MAX_SHOWN, set[str]()
    for spot in _spots(read_xml(text, str(path)), data):
        try:
            sent = _sent(spot, source)
            if not sent:
                continue
            if sent in sent_before:
                sent = again(sent)
            elif spot.use != "collision":
                if len(sent) > room:
                    problem = (
                        f"the visual meshes take more than {MAX_SHOWN / 1e6:g} MB "
                        "compressed; simplify them"
                    )
                    raise RobotError(problem)
                room -= len(sent)
                sent_before.add(sent)
        except (RobotError, ImportError) as error:
            # the whole mesh is too large to be sent
            if spot.use == "collision" and _is_fixed(spot.tag):
                with suppress(RobotError):
                    hull = data_uri(resolve_uri(spot.uri.strip(), path, packages))
                    replaced.append((spot.start, spot.end, hull))
                hulls.append(str(error))
            elif spot.use != "collision":
                unsent.setdefault(cut(spot.uri.strip()), str(error))
        else:
            replaced.append((spot.start, spot.end, sent))
    data = _with_replaced(data, replaced)
    kinds = "mesh {} is" if len(unsent) == 1 else "meshes {} are"
    line = (
        f"{path}: the visual {kinds.format(', '.join(unsent))} not sent: "
        f"{next(iter(unsent.values()), '')}"
    )
    told = (
        [f"{path}: only the convex hull of a collision mesh is sent: {hulls[0]}"] if hulls else []
    )
    return data.decode(), (*told, line) if unsent else tuple(told)


def _with_replaced(data: bytes, replaced: list[tuple[int, int, str]]) -> bytes:
    """The text with other content at the places, which are in its order."""
    for start, end, sent in reversed(replaced):  # so earlier offsets stay valid
        data = data[:start] + sent.encode() + data[end:]
    return data


class _Spot(NamedTuple):
    """Where a text names a file: the `use` of a mesh (collision or visual) or "image"; the first
    byte and the end of its URI; that URI; and the element that it belongs to, of an image its
    material.
    """

    use: str
    start: int
    end: int
    uri: str
    tag: Tag


def _sent(spot: _Spot, source: Source) -> str:
    """What to send in place of a URI; empty to leave it. Raises RobotError."""
    if not spot.uri.strip() or is_data(spot.uri):
        return ""
    if spot.use == "image":
        return texture_of(spot.tag, source)
    try:
        file = resolve_uri(spot.uri.strip(), source.origin, source.packages)
    except RobotError:
        return ""
    if spot.use == "collision":
        return triangles_uri(file) if _is_fixed(spot.tag) else data_uri(file)
    return mesh_uri(file, source) or file_uri(file)


def _is_fixed(mesh: Tag) -> bool:
    """Whether a mesh is that of a static model or robot."""
    owner: Tag | None = mesh
    while owner is not None:
        if (
            owner.name == "model" and owner.child("static").text.strip().lower() in ("1", "true")
        ) or (owner.name == "robot" and is_static(owner)):
            return True
        owner = owner.parent
    return False


def _spots(root: Tag, data: bytes) -> Iterator[_Spot]:
    """The names of all meshes and images in a text, in its order."""
    for tag in root.walk():
        above = (
            tag.parent.parent.name
            if tag.parent and tag.parent.parent and tag.parent.name == "geometry"
            else ""
        )
        if tag.name == "mesh" and above in USES:
            if "filename" in tag.attributes and (match := _FILENAME.search(data, tag.at)):
                yield _Spot(
                    above, match.start(1) + 1, match.end(1) - 1, tag.attributes["filename"], tag
                )
            for inside in tag.all("uri"):
                yield _spot_of_text(above, inside, tag, data)
        material = tag.parent if tag.parent and tag.parent.name == "material" else None
        if material and tag.name == "texture" and (match := _FILENAME.search(data, tag.at)):
            yield _Spot(
                "image",
                match.start(1) + 1,
                match.end(1) - 1,
                tag.attributes.get("filename", ""),
                material,
            )
        if material and tag.name == "script" and (first := tag.first("uri")):
            yield _spot_of_text("image", first, material, data)
        if tag.name == "albedo_map":
            yield _spot_of_text("image", tag, replace(tag, name="material", children=[tag]), data)


def _spot_of_text(use: str, inside: Tag, tag: Tag, data: bytes) -> _Spot:
    start = data.index(b">", inside.at) + 1
    return _Spot(use, start, data.index(b"</", start), inside.text, tag)
