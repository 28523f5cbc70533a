"""`<include>` in SDF files: from a URI to the model that it stands for."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from holozen.robot.errors import RobotError, cut
from holozen.robot.packages import find_named, folders_above, local_packages
from holozen.robot.sdf.values import word
from holozen.robot.source import Source
from holozen.robot.tag import Tag, check_size, read_xml
from holozen.robot.uris import MODEL_PATHS
from holozen.robot.xacro import read_text

DEEPEST = 20  # includes within each other
MOST_PARTS = 5000  # models and links of one world; a few short files can include each other a million times

SUN = "sun"  # a light, which is no model
PLANE = """
<model name="ground_plane">
  <static>true</static>
  <link name="link">
    <collision name="collision"><geometry><plane><size>100 100</size></plane></geometry></collision>
    <visual name="visual">
      <geometry><plane><size>100 100</size></plane></geometry>
      <material><diffuse>0.7 0.7 0.7 1</diffuse></material>
    </visual>
  </link>
</model>
"""
BUILT_IN = {"ground_plane": PLANE, "asphalt_plane": PLANE}
"""Models of Gazebo's library that worlds take for granted."""

_MODEL_NAME = re.compile(r"[\w .-]+")


@dataclass(frozen=True, slots=True)
class Piece:
    """A `<model>` element with the version of SDF it is written in, and where its own URIs start from.

    `chain` is the files that include each other down to it.
    """

    tag: Tag
    source: Source
    version: tuple[int, ...]
    chain: tuple[Path, ...] = ()


@dataclass(slots=True)
class Includes:
    """Models by URI, each file read once; a text that came over the wire gets those of known folders only.

    `told` is what was warned of once and need not be again.
    """

    count: int = 0
    told: set[str] = field(default_factory=set)
    _files: dict[Path, Tag] = field(default_factory=dict)
    _paths: dict[tuple[str, Path], Path] = field(default_factory=dict)

    def within(self, outer: Piece) -> Iterator[Piece]:
        """The models directly inside a model or a world, in the order of the file. Raises RobotError.

        An included one is told by the `<include>`'s own name, pose and static. One that is not found makes a warning.
        """
        for tag in outer.tag.children:
            if tag.name not in ("model", "include"):
                continue
            piece: Piece | None = replace(outer, tag=tag)
            if tag.name == "include":
                piece = self.included(replace(outer, tag=tag))
            self._count(piece.tag if piece else tag)
            if piece is not None:
                yield piece

    def included(self, outer: Piece) -> Piece | None:
        """What one `<include>` stands for. Raises RobotError for a broken file and for a circle."""
        tag, uri = outer.tag, word(outer.tag, "uri")
        if not uri:
            raise tag.wrong("has no <uri>; write <uri>model://NAME</uri>")
        name = uri.removeprefix("model://").strip("/")
        if name == SUN:
            return None
        if name in BUILT_IN:
            model = read_xml(BUILT_IN[name], tag.place)
            return replace(outer, tag=_overridden(model, tag, tag.place))
        path = self._path(outer, uri)
        if path is None:
            return None
        if path in outer.chain or len(outer.chain) == DEEPEST:
            names = " -> ".join(str(file) for file in (*outer.chain, path)[-4:])
            raise tag.wrong(f"includes without end: {names}")
        root = self._read(path)
        model = _model_of(root, tag, path)
        source = replace(outer.source, origin=path, packages={**outer.source.packages, **_own_name(uri, path)})
        return Piece(_overridden(model, tag, model.place), source, version_of(root), (*outer.chain, path))

    def _count(self, tag: Tag) -> None:
        self.count += 1 + len(tag.all("link"))
        if self.count > MOST_PARTS:
            raise tag.wrong(f"brings the models and links there are to more than {MOST_PARTS}; take some models away")

    def _read(self, path: Path) -> Tag:
        if path not in self._files:
            self._files[path] = read_file(path)
        return self._files[path]

    def _path(self, outer: Piece, uri: str) -> Path | None:
        key = uri, outer.source.origin
        found = self._paths.get(key) or _found(outer, uri)
        if found is not None:
            self._paths[key] = found
        return found


def _model_of(root: Tag, include: Tag, path: Path) -> Tag:
    model = root.first("model") if root.name == "sdf" else None
    if model is None:
        raise include.wrong(f"includes {path}, which holds no <sdf><model>")
    return model


def read_file(path: Path) -> Tag:
    """The root of an SDF file. Raises RobotError."""
    if path.is_file():
        check_size(path.stat().st_size, str(path))
    return read_xml(read_text(path), str(path))


def version_of(root: Tag) -> tuple[int, ...]:
    """The version of an `<sdf>`, as numbers; the newest where it says none."""
    return tuple(int(part) for part in re.findall(r"\d+", root.attributes.get("version", ""))[:2]) or (1, 11)


def _found(outer: Piece, uri: str) -> Path | None:
    places = list(dict.fromkeys(_places(outer.source, uri)))
    if not places:
        outer.source.warn(outer.tag, f"({cut(uri)}) is not fetched and left out; write model://NAME")
        return None
    files = (file for place in places if (file := _model_file(place)))
    found = next((file for file in files if not outer.source.confined or _is_known(file, outer.source)), None)
    if found is None:
        shown = ", ".join(cut(str(place.parent), 200)[1:-1] for place in places[:6])
        more = f" and {len(places) - 6} more" if len(places) > 6 else ""
        mend = "add its folder to GZ_SIM_RESOURCE_PATH or give --package NAME=DIR"
        outer.source.warn(outer.tag, f"({cut(uri)}) is not found and left out; looked in {shown}{more}; {mend}")
    return found


def _places(source: Source, uri: str) -> Iterator[Path]:
    """Where the model may be, in the order of preference: its folder or its file."""
    scheme, _, rest = uri.rpartition("://")
    if scheme in ("", "file") and not source.confined:
        yield _folder(source.origin) / rest
    if scheme in ("", "model", "package"):
        yield from _model_places(rest, source)


def _model_places(rest: str, source: Source) -> Iterator[Path]:
    name, _, inside = rest.strip("/").partition("/")
    if not _MODEL_NAME.fullmatch(name) or ".." in (name, *inside.split("/")):
        return
    if name in source.packages:
        yield source.packages[name] / inside
    for folder in _shared() if source.confined else (*_shared(), *_near(source.origin)):
        yield folder / name / inside
    package = None if source.confined else _package(name, source)
    if package is not None:
        yield package / inside


def _shared() -> list[Path]:
    parts = [part for key in MODEL_PATHS for part in os.environ.get(key, "").split(os.pathsep)]
    return [Path(part) for part in parts if os.path.isabs(part)]


def _is_known(file: Path, source: Source) -> bool:
    """Whether a file, symbolic links followed, lies in a folder that a text from anywhere may name."""
    roots = [os.path.realpath(folder) for folder in (*source.packages.values(), *_shared())]
    return any(str(file).startswith(root + os.sep) for root in roots)


def _near(origin: Path) -> Iterator[Path]:
    """Folders of models around a file: above it, in the packages there, and Gazebo's own of this user."""
    for folder in folders_above(origin):
        yield from (folder / "models", folder)
    yield from (folder / "models" for folder in local_packages(origin).values())
    yield Path.home() / ".gazebo" / "models"


def _package(name: str, source: Source) -> Path | None:
    try:
        return find_named(name, source.origin, source.packages)
    except RobotError:  # a model's name need not be one that a package can have
        return None


def _model_file(place: Path) -> Path | None:
    """The SDF file that `place` is, or the one that the folder `place` names in its model.config."""
    if os.path.isfile(place):
        return Path(os.path.realpath(place))
    config = place / "model.config"
    names = [*_configured(config), "model.sdf"] if os.path.isfile(config) else ["model.sdf"]
    found = (place / name for name in names if os.path.isfile(place / name))
    return next((Path(os.path.realpath(file)) for file in found), None)


def _configured(config: Path) -> list[str]:
    """The files that a model.config names, that of the newest SDF first; none outside its folder."""
    tags = read_file(config).all("sdf")
    names = [tag.text.strip() for tag in sorted(tags, key=version_of, reverse=True)]
    return [name for name in names if "/" not in name and "\\" not in name]


def _own_name(uri: str, path: Path) -> dict[str, Path]:
    """What an included model may call its own folder in the URIs of its meshes."""
    name = uri.rpartition("://")[2].strip("/").partition("/")[0]
    return {name: path.parent} if path.parent.name == name else {}


def _folder(origin: Path) -> Path:
    return Path(os.path.abspath(origin if os.path.isdir(origin) else origin.parent))


def _overridden(model: Tag, include: Tag, place: str) -> Tag:
    """The model as its `<include>` names, places and holds it; messages say it stands at `place`."""
    given = {tag.name for tag in include.children if tag.name in ("pose", "static")}
    name = word(include, "name")
    attributes = {**model.attributes, **({"name": name} if name else {})}
    kept = [tag for tag in model.children if tag.name not in given]
    added = [tag for tag in include.children if tag.name in (*given, "plugin", "placement_frame")]
    return Tag("model", attributes, place, None, "", [*kept, *added])
