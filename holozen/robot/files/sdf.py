"""SDF elements -> values, shapes, links and joints; and `<include>` -> the model that its URI
names.
"""

import math
import os
import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from itertools import product
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from holozen.packages import (
    MODEL_PATHS,
    find_named,
    folder_of,
    folders_above,
    folders_listed,
    local_packages,
)
from holozen.robot.errors import RobotError
from holozen.robot.files import gazebo_models
from holozen.robot.files.elements import SHORTEST, Source, Tag, read_text, read_xml
from holozen.robot.files.inertial import read_inertia, with_moments
from holozen.robot.files.meshes import FARTHEST
from holozen.robot.files.shapes import (
    SHAPES,
    SIZES,
    geometry_of,
    material_color,
    mesh_shape,
    read_size,
    tags,
)
from holozen.robot.files.textures import texture_of
from holozen.robot.files.urdf import read_dynamics, read_mimic
from holozen.robot.inertia import NO_INERTIA
from holozen.robot.model import Color, Inertial, Joint, Limits, Link, Pose, Shape, Surface, Vector
from holozen.robot.rigid import Frame, compose
from holozen.robot.rotation import triple
from holozen.rotation import to_rpy
from holozen.suggest import cut

# Text of elements: numbers, vectors, flags, names and poses.


ENDLESS = 1e16  # SDF's own number for a joint without a limit
UP = (0.0, 0.0, 1.0)  # SDF's default direction


class Placed(Struct, frozen=True):
    """A pose, and the name of the frame it is relative to; empty for the default frame of its
    element.
    """

    pose: Pose
    within: str


def flag(tag: Tag, name: str, default: bool) -> bool:
    """True or false in the child called `name`. Raises RobotError."""
    child = tag.first(name)
    if child is None:
        return default
    text = child.text.strip().lower()
    if text not in ("true", "1", "false", "0"):
        raise child.wrong(f"is {cut(text)}; it must be true or false")
    return text in ("true", "1")


def read_pose(tag: Tag) -> Placed:
    """The `<pose>` of an element, zero without one. Raises RobotError."""
    pose = tag.first("pose")
    if pose is None:
        return Placed(Pose(), "")
    # SDF 1.5 and 1.6 called it frame.
    within = pose.attributes.get("relative_to", pose.attributes.get("frame", "")).strip()
    return Placed(_pose(pose), within)


def _pose(tag: Tag) -> Pose:
    if not tag.text.strip():
        return Pose()
    if tag.attributes.get("rotation_format", "euler_rpy") == "quat_xyzw":
        return _with_quaternion(tag)
    x, y, z, *turns = tag.content(6, most=FARTHEST)
    if tag.attributes.get("degrees", "false").strip().lower() in ("true", "1"):
        turns = [math.radians(turn) for turn in turns]
    roll, pitch, yaw = turns
    return Pose((x, y, z), (roll, pitch, yaw))


def _with_quaternion(tag: Tag) -> Pose:
    x, y, z, *turn = tag.content(7, most=FARTHEST)
    length = math.hypot(*turn)
    if length < SHORTEST:
        raise tag.wrong("has a quaternion of length 0; write 0 0 0 1 for no rotation")
    a, b, c, w = (part / length for part in turn)
    return Pose((x, y, z), to_rpy((a, b, c, w)))


# The elements of SDF: others, such as misspelt ones, cause a warning.


_PHYSICAL = "pose frame plugin sensor"

KNOWN = {
    "model": f"{_PHYSICAL} static self_collide allow_auto_disable enable_wind link joint model "
    "include gripper"
    " placement_frame",
    "link": f"{_PHYSICAL} inertial collision visual self_collide gravity kinematic enable_wind "
    "must_be_base_link"
    " velocity_decay light projector battery particle_emitter audio_source audio_sink",
    "inertial": "pose frame mass inertia density fluid_added_mass",
    "inertia": "ixx ixy ixz iyy iyz izz",
    "visual": f"{_PHYSICAL} geometry material transparency cast_shadows laser_retro "
    "visibility_flags meta",
    "collision": f"{_PHYSICAL} geometry surface max_contacts laser_retro density "
    "auto_inertia_params",
    "material": "ambient diffuse specular emissive shininess script shader lighting pbr "
    "double_sided render_order",
    "joint": f"{_PHYSICAL} parent child axis axis2 physics thread_pitch screw_thread_pitch "
    "gearbox_ratio"
    " gearbox_reference_body",
    "axis": "xyz limit dynamics mimic initial_position use_parent_model_frame",
    "limit": "lower upper effort velocity stiffness dissipation",
    "dynamics": "damping friction spring_reference spring_stiffness",
    "surface": "friction contact bounce soft_contact",
}
"""Element -> its allowed children; elements not listed here may contain anything."""

IN_WORLD = (
    "model",
    "include",
    "light",
    "physics",
    "gravity",
    "frame",
    "gui",
    "scene",
    "state",
    "plugin",
    "audio",
    "wind",
    "magnetic_field",
    "atmosphere",
    "spherical_coordinates",
)
NOT_SIMULATED = ("actor", "population", "road", "joint")


def check_known(tag: Tag, source: Source, warned: set[str]) -> None:
    """Warn about elements that SDF does not define, inside `tag` and below; once for each, recorded
    in `warned`.

    Elements with a namespace prefix, such as `a:b`, are custom and not checked.
    """
    known = KNOWN[tag.name].split()
    for child in tag.children:
        if child.name not in known:
            _warn_unknown(tag, child, known, source, warned)
        elif child.name in KNOWN and child.name != "model":  # nested models are checked separately
            check_known(child, source, warned)


def check_world(tag: Tag, source: Source, warned: set[str]) -> None:
    """As `check_known`, for the elements directly in a world; also warns about those that are not
    simulated.
    """
    for child in tag.children:
        if child.name in NOT_SIMULATED:
            source.warn(child, "is not simulated and is left out")
        elif child.name not in IN_WORLD:
            _warn_unknown(tag, child, IN_WORLD, source, warned)


def _warn_unknown(
    outer: Tag, child: Tag, known: Iterable[str], source: Source, warned: set[str]
) -> None:
    key = f"{outer.name} {child.name}"
    if ":" not in child.name and key not in warned:
        warned.add(key)
        near = source.suggest(child.name, known)
        source.warn(child, f"is not an SDF child of <{outer.name}> and is ignored{near}")


# Shapes.


AROUND, UPWARDS = 16, 9  # points of a round hull: per circle, and circles from pole to pole

UNSUPPORTED = ("heightmap", "polyline", "image")


def read_shape(tag: Tag, frame: Pose, source: Source, fixed: bool = False) -> Shape | None:
    """A `<visual>` or `<collision>`; None if it is empty, or left out with a warning. `frame` is
    the pose of its `<link>` element in the link that this becomes part of; `fixed` as for
    `mesh_shape`. Raises RobotError.

    A capsule, a cone and an ellipsoid become the hull of points on their surface, at most 2 %
    smaller in cross-section.
    """
    pose = compose(frame, read_pose(tag).pose)
    shape = geometry_of(tag, SIZES, (*UNSUPPORTED, "empty"))
    if tag.name != "visual":
        return _read_shape(tag, shape, pose, None, source, fixed)
    material = tag.first("material")
    texture = "" if material is None else texture_of(material, source)
    found = _read_shape(tag, shape, pose, None if texture else _color(tag, source), source)
    return replace(found, texture=texture) if found and texture else found


def _read_shape(
    tag: Tag, shape: Tag, pose: Pose, color: Color | None, source: Source, fixed: bool = False
) -> Shape | None:
    if shape.name == "empty":
        return None
    if shape.name in UNSUPPORTED:
        source.warn(shape, f"({tag.name}) is left out; use {tags(SIZES)} or <mesh>")
        return None
    if shape.name == "mesh":
        return _mesh(shape, tag.name, pose, color, source, fixed)
    if shape.name == "plane":
        placed = compose(pose, _turned_to(shape.direction("normal", UP)))
        return Shape("plane", read_size(shape, (1.0, 1.0)), placed, color=color)
    size = read_size(shape)
    if shape.name in SHAPES:
        return Shape(shape.name, size, pose, color=color)
    return Shape("hull", (), pose, color=color, points=tuple(_HULLS[shape.name](size)))


def _turned_to(normal: Vector) -> Pose:
    """The rotation that takes z to `normal`."""
    x, y, z = normal
    return Pose(rpy=(0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)))


def _mesh(
    tag: Tag, use: str, pose: Pose, color: Color | None, source: Source, fixed: bool
) -> Shape | None:
    if tag.first("submesh") is not None:
        source.warn(tag, f"({use}) names a <submesh>; the whole file is used")
    uri = tag.given("uri")
    if not uri:
        raise tag.wrong("has no <uri>")
    return mesh_shape(tag, uri, pose, use, source, color, fixed)


def _color(tag: Tag, source: Source) -> Color | None:
    """A visual's colour, with alpha from its `<transparency>`."""
    material = tag.first("material")
    color = None if material is None else material_color(material, source)
    if color is None:
        return None
    red, green, blue, alpha = color
    return red, green, blue, alpha * (1 - min(max(tag.number("transparency", 0.0), 0.0), 1.0))


def _capsule(size: tuple[float, ...]) -> list[Vector]:
    radius, length = size
    ball = [(x * radius, y * radius, z * radius) for x, y, z in _ball()]
    return [
        (x, y, z + math.copysign(length / 2, end))
        for end in (1, -1)
        for x, y, z in ball
        if z * end > -NOISE
    ]


def _cone(size: tuple[float, ...]) -> list[Vector]:
    radius, length = size
    return [(0.0, 0.0, length / 2), *((x * radius, y * radius, -length / 2) for x, y in _circle())]


def _ellipsoid(size: tuple[float, ...]) -> list[Vector]:
    a, b, c = size
    return [(a * x, b * y, c * z) for x, y, z in _ball()]


def _circle() -> list[tuple[float, float]]:
    turns = [2 * math.pi * step / AROUND for step in range(AROUND)]
    return [(math.cos(turn), math.sin(turn)) for turn in turns]


@lru_cache(1)
def _ball() -> list[Vector]:
    """Points on the unit sphere, including the poles and the equator."""
    rings = [math.pi * step / (UPWARDS - 1) for step in range(1, UPWARDS - 1)]
    body = [
        (math.sin(up) * x, math.sin(up) * y, math.cos(up))
        for up, (x, y) in product(rings, _circle())
    ]
    return [(0.0, 0.0, 1.0), *body, (0.0, 0.0, -1.0)]


_HULLS = {"capsule": _capsule, "cone": _cone, "ellipsoid": _ellipsoid}

# Links.


GAZEBOS_INERTIAL = Inertial(Pose(), 1.0, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))


class ModelFlags(Struct, frozen=True):
    """A model's settings for all its links."""

    static: bool
    self_collide: bool


def read_link(tag: Tag, name: str, frame: Pose, flags: ModelFlags, source: Source) -> Link:
    """The link of a `<link>` element. `frame` is the element's pose in that link. Raises
    RobotError.
    """
    if flag(tag, "kinematic", False) and not flags.static:
        source.warn(
            tag,
            "is kinematic, which is not simulated; gravity and contacts act on it as on any link",
        )
    visuals = [read_shape(visual, frame, source) for visual in tag.all("visual")]
    collisions = [
        read_shape(collision, frame, source, flags.static) for collision in tag.all("collision")
    ]
    link = Link(
        name=name,
        inertial=_inertial(tag, frame, flags.static, source),
        visuals=tuple(shape for shape in visuals if shape is not None),
        collisions=tuple(shape for shape in collisions if shape is not None),
        surface=_surface(tag, flag(tag, "self_collide", flags.self_collide), source),
        gravity=flag(tag, "gravity", True),
    )
    return with_moments(link, tag.first("inertial"), source, silent=flags.static)


def _inertial(tag: Tag, frame: Pose, static: bool, source: Source) -> Inertial | None:
    inertial = tag.first("inertial")
    if inertial is None:
        if not static:
            source.warn(
                tag,
                "has no <inertial>; as in Gazebo it is treated as 1 kg with 1 kg m^2 about each "
                "axis",
            )
        return None if static else GAZEBOS_INERTIAL
    if inertial.attributes.get("auto", "false").strip().lower() in ("true", "1") and not static:
        source.warn(inertial, 'has auto="true", which is not supported; write <mass> and <inertia>')
    mass = inertial.number("mass", 1.0)
    if mass < 0:
        raise inertial.child("mass").wrong(f"is {mass} kg, which is negative")
    if mass == 0 and not static:
        source.warn(inertial, "has no mass; the link is treated as massless, with no inertia")
    pose = compose(frame, read_pose(inertial).pose)
    return Inertial(pose, mass, read_inertia(inertial) if mass else NO_INERTIA)


def _surface(tag: Tag, self_collide: bool, source: Source) -> Surface:
    """The surface of the first collision that has one, which is used for all collisions of the
    link.
    """
    found = [
        surface for collision in tag.all("collision") if (surface := collision.first("surface"))
    ]
    values = [tuple(_first(surface, paths) for paths in SURFACE.values()) for surface in found]
    if any(other != values[0] for other in values):
        source.warn(tag, "has collisions with different surfaces; the first is used for all")
    mu1, mu2, kp, kd = values[0] if values else (None, None, None, None)
    return Surface(mu1, mu2, kp, kd, self_collide)


SURFACE = {
    "mu1": ("friction/ode/mu", "friction/bullet/friction"),
    "mu2": ("friction/ode/mu2", "friction/bullet/friction2"),
    "kp": ("contact/ode/kp", "contact/bullet/kp"),
    "kd": ("contact/ode/kd", "contact/bullet/kd"),
}
"""Surface parameter -> its possible paths; the first one present counts."""


def _first(surface: Tag, paths: tuple[str, ...]) -> float | None:
    for path in paths:
        tag: Tag | None = surface
        for name in path.split("/"):
            tag = tag.first(name) if tag else None
        if tag is not None:
            (number,) = tag.content(1, most=math.inf)
            if number < 0:
                raise tag.wrong(f"is {number}, which is negative")
            return number
    return None


# Joints.


KINDS = ("continuous", "revolute", "prismatic", "fixed")
AS_FIXED = ("ball", "universal", "screw", "revolute2")
ROLLING = ("ball", "universal")  # of those; a caster on one rolls in every direction
GEARBOX = "gearbox"  # couples two other joints; connects no links

NOISE = 1e-12  # rounding error of a rotated unit vector


def read_joint(
    tag: Tag, name: str, ends: tuple[str, str], frames: tuple[Frame, Frame], axis: Vector
) -> Joint:
    """The joint of a `<joint>` element. `ends` are its parent and child link, `frames` theirs in
    the world, and `axis` is a unit vector in the world. Raises RobotError.
    """
    (parent, child), (outer, inner), axis_tag = ends, frames, tag.child("axis")
    kind, pose = kind_of(tag), (outer.inverse @ inner).pose
    if kind == "fixed":
        return Joint(name, kind, parent, child, pose, (1.0, 0.0, 0.0), Limits())
    limits = _limits(axis_tag)
    if kind == "revolute" and (limits.lower, limits.upper) == (-math.inf, math.inf):
        kind = "continuous"
    if kind == "continuous":
        limits = Limits(limits.effort, limits.velocity)
    turned = _clean(triple(inner.inverse.rotation @ axis))
    return Joint(
        name,
        kind,
        parent,
        child,
        pose,
        turned,
        limits,
        *read_dynamics(axis_tag),
        read_mimic(axis_tag),
    )


def has_spring(tag: Tag) -> bool:
    """Whether a joint has a spring. Raises RobotError."""
    return tag.child("axis").child("dynamics").number("spring_stiffness", 0.0, most=math.inf) != 0


def kind_of(tag: Tag) -> str:
    """One of KINDS; those in AS_FIXED become "fixed". Raises RobotError."""
    kind = tag.word("type").strip()
    if kind not in (*KINDS, *AS_FIXED, GEARBOX):
        known = ", ".join((*KINDS, *AS_FIXED, GEARBOX))
        raise tag.wrong(f"has unknown type {cut(kind)}; known types: {known}")
    return "fixed" if kind in AS_FIXED else kind


def rolls(tag: Tag) -> bool:
    """Whether a joint lets its link roll in every direction, though it is treated as fixed."""
    return tag.attributes.get("type", "").strip() in ROLLING


def axis_of(tag: Tag, version: tuple[int, ...]) -> tuple[Vector, str]:
    """The unit vector a joint turns about or slides along, and the name of the frame it is
    expressed in; empty for the joint's own. Raises RobotError.
    """
    axis = tag.child("axis")
    xyz = axis.first("xyz")
    within = "" if xyz is None else xyz.attributes.get("expressed_in", "").strip()
    # Up to SDF 1.4 axes are in the model's frame, in 1.5 and 1.6 only if the flag is set.
    if flag(axis, "use_parent_model_frame", version < (1, 5)):
        within = within or "__model__"
    return axis.direction("xyz", UP), within


def _limits(axis: Tag) -> Limits:
    limit = axis.child("limit")
    effort, velocity = (limit.number(name, -1.0, most=math.inf) for name in ("effort", "velocity"))
    lower, upper = (
        limit.number(name, bound, most=math.inf)
        for name, bound in (("lower", -ENDLESS), ("upper", ENDLESS))
    )
    if lower > upper:
        raise limit.wrong(f"has lower {lower} above upper {upper}")
    return Limits(
        effort=math.inf if effort < 0 else effort,
        velocity=math.inf if velocity < 0 else velocity,
        lower=-math.inf if lower <= -ENDLESS else lower,
        upper=math.inf if upper >= ENDLESS else upper,
    )


def _clean(axis: Vector) -> Vector:
    x, y, z = (0.0 if abs(part) < NOISE else part for part in axis)
    return x, y, z


# Includes.


DEEPEST = 20  # nesting of includes
MAX_PARTS = 5000  # models and links of one world; a few short files can expand to a million

_MODEL_NAME = re.compile(r"[\w .-]+")


class Piece(Struct, frozen=True):
    """A `<model>` element with its SDF version, and as `source` the file that its URIs are relative
    to.

    `chain` are the files that include it, outermost first.
    """

    tag: Tag
    source: Source
    version: tuple[int, ...]
    chain: tuple[Path, ...] = ()


class Includes(Struct):
    """Reads included models, each file once; a text received over the network may use those of
    known folders only.

    `warned` are the unknown elements that have had a warning.
    """

    count: int = 0
    warned: set[str] = set()
    _files: dict[Path, Tag] = {}
    _paths: dict[tuple[str, Path], Path] = {}

    def within(self, outer: Piece) -> Iterator[Piece]:
        """The models directly inside a model or a world, in file order. Raises RobotError.

        An `<include>`'s own name, pose and static override the model's. A model that is not found
        causes a warning.
        """
        for tag in outer.tag.children:
            if piece := self.one(outer, tag):
                yield piece

    def one(self, outer: Piece, tag: Tag) -> Piece | None:
        """The model that a child of a model or a world is or includes; None if it is neither, or
        nothing is found. Raises RobotError.
        """
        if tag.name not in ("model", "include"):
            return None
        own = replace(outer, tag=tag)
        piece = self.included(own) if tag.name == "include" else own
        self._count(piece.tag if piece else tag)
        return piece

    def included(self, outer: Piece) -> Piece | None:
        """The model of an `<include>`. Raises RobotError for a broken file and for circular
        includes.
        """
        tag, uri = outer.tag, outer.tag.given("uri")
        if not uri:
            raise tag.wrong("has no <uri>; write <uri>model://NAME</uri>")
        name = gazebo_models.name_in(uri)
        if name == gazebo_models.SUN:
            return None
        path = None if name in gazebo_models.PLANES else self._path(outer, uri)
        if path is None:
            own = gazebo_models.sdf_of(name)
            return (
                replace(
                    outer, tag=_overridden(read_xml(own, tag.place).children[0], tag, tag.place)
                )
                if own
                else None
            )
        if path in outer.chain or len(outer.chain) == DEEPEST:
            names = " -> ".join(str(file) for file in (*outer.chain, path)[-4:])
            raise tag.wrong(f"has circular or too deeply nested includes: {names}")
        root = self._read(path, outer.source)
        model = _model_of(root, tag, path)
        source = replace(
            outer.source, origin=path, packages={**outer.source.packages, **_own_name(uri, path)}
        )
        return Piece(
            _overridden(model, tag, model.place), source, version_of(root), (*outer.chain, path)
        )

    def _count(self, tag: Tag) -> None:
        self.count += 1 + len(tag.all("link"))
        if self.count > MAX_PARTS:
            raise tag.wrong(
                f"brings the number of models and links above {MAX_PARTS}; remove some models"
            )

    def _read(self, path: Path, source: Source) -> Tag:
        if path not in self._files:
            self._files[path] = read_file(path, source)
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
        raise include.wrong(f"includes {path}, which contains no <sdf><model>")
    return model


def read_file(path: Path, source: Source) -> Tag:
    """The root of an SDF file; warnings go to `source`. Raises RobotError."""
    return source.read(read_text(path), str(path))


def version_of(root: Tag) -> tuple[int, ...]:
    """The version of an `<sdf>`, as numbers; the newest if not given."""
    return tuple(
        int(part) for part in re.findall(r"\d+", root.attributes.get("version", ""))[:2]
    ) or (1, 11)


def _found(outer: Piece, uri: str) -> Path | None:
    places = list(dict.fromkeys(_places(outer.source, uri)))
    is_known = bool(gazebo_models.sdf_of(gazebo_models.name_in(uri)))
    if not places and not is_known:
        outer.source.warn(
            outer.tag, f"({cut(uri)}) is not fetched and is left out; write model://NAME"
        )
        return None
    files = (file for place in places if (file := _model_file(place, outer.source)))
    found = next(
        (file for file in files if not outer.source.confined or _is_known(file, outer.source)), None
    )
    if found is None and not is_known:
        shown = ", ".join(cut(str(place.parent), 200)[1:-1] for place in places[:6])
        more = f" and {len(places) - 6} more" if len(places) > 6 else ""
        hint = "add its folder to GZ_SIM_RESOURCE_PATH or give --package NAME=DIR"
        outer.source.warn(
            outer.tag, f"({cut(uri)}) is not found and is left out; looked in {shown}{more}; {hint}"
        )
    return found


def _places(source: Source, uri: str) -> Iterator[Path]:
    """Candidate folders and files of the model, in order of preference."""
    scheme, _, rest = uri.rpartition("://")
    if scheme in ("", "file") and not source.confined:
        yield folder_of(source.origin) / rest
    if scheme in ("", "model", "package"):
        yield from _model_places(rest, source)


def _model_places(rest: str, source: Source) -> Iterator[Path]:
    name, _, inside = rest.strip("/").partition("/")
    if not _MODEL_NAME.fullmatch(name) or ".." in (name, *inside.split("/")):
        return
    if name in source.packages:
        yield source.packages[name] / inside
    for folder in (
        *folders_listed(*MODEL_PATHS, absolute=True),
        *([] if source.confined else _near(source.origin)),
    ):
        yield folder / name / inside
    package = None if source.confined else _package(name, source)
    if package is not None:
        yield package / inside


def _is_known(file: Path, source: Source) -> bool:
    """Whether a file, symbolic links resolved, is in a folder that untrusted text may refer to."""
    roots = [
        os.path.realpath(folder)
        for folder in (*source.packages.values(), *folders_listed(*MODEL_PATHS, absolute=True))
    ]
    return any(str(file).startswith(root + os.sep) for root in roots)


def _near(origin: Path) -> Iterator[Path]:
    """Folders of models around a file: above it, in packages there, and the user's
    ~/.gazebo/models.
    """
    for folder in folders_above(origin):
        yield from (folder / "models", folder)
    yield from (folder / "models" for folder in local_packages(origin).values())
    yield Path.home() / ".gazebo" / "models"


def _package(name: str, source: Source) -> Path | None:
    try:
        return find_named(name, source.origin, source.packages)
    except RobotError:  # not every model name is a valid package name
        return None


def _model_file(place: Path, source: Source) -> Path | None:
    """The SDF file that `place` is, or the one that the folder `place` names in its model.config,
    whose warnings go to `source`.
    """
    if os.path.isfile(place):
        return Path(os.path.realpath(place))
    config = place / "model.config"
    names = [*_configured(config, source), "model.sdf"] if os.path.isfile(config) else ["model.sdf"]
    found = (place / name for name in names if os.path.isfile(place / name))
    return next((Path(os.path.realpath(file)) for file in found), None)


def _configured(config: Path, source: Source) -> list[str]:
    """The files that a model.config names, newest SDF version first; none outside its folder."""
    own = Source(config, {})
    tags = read_file(config, own).all("sdf")
    source.warnings += own.warnings
    names = [tag.text.strip() for tag in sorted(tags, key=version_of, reverse=True)]
    return [name for name in names if "/" not in name and "\\" not in name]


def _own_name(uri: str, path: Path) -> dict[str, Path]:
    """The package name by which the mesh URIs of an included model may refer to its own folder ->
    that folder.
    """
    name = uri.rpartition("://")[2].strip("/").partition("/")[0]
    return {name: path.parent} if path.parent.name == name else {}


def _overridden(model: Tag, include: Tag, place: str) -> Tag:
    """The model with its `<include>`'s name, pose and static applied; messages locate it at
    `place`.
    """
    given = {tag.name for tag in include.children if tag.name in ("pose", "static")}
    name = include.given("name")
    attributes = {**model.attributes, **({"name": name} if name else {})}
    kept = [tag for tag in model.children if tag.name not in given]
    added = [tag for tag in include.children if tag.name in (*given, "plugin", "placement_frame")]
    return Tag("model", attributes, place, None, "", [*kept, *added], sdf=True)
