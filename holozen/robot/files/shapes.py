"""Shapes and colours of URDF, and what URDF and SDF share: meshes, placeholder boxes and Gazebo's
materials.
"""

import math
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress

from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import LARGEST, Source, Tag, number
from holozen.robot.files.meshes import FARTHEST, data_hull, data_triangles, hull, triangles_of
from holozen.robot.files.textures import mesh_uri, texture_of
from holozen.robot.files.uris import is_data, resolve_uri
from holozen.robot.model import Color, Pose, Shape, Vector
from holozen.suggest import cut

# Colours, by Gazebo's names or as numbers.


# Names and diffuse colours of Gazebo Classic's media/materials/scripts/gazebo.material, transparent
# ones with their blending alpha. Gazebo's own textures are not shown: the last three rows have the
# colour beneath the texture.
_NAMES: dict[str, Color] = {
    "Grey": (0.7, 0.7, 0.7, 1.0),
    "DarkGrey": (0.175, 0.175, 0.175, 1.0),
    "White WhiteGlow JointAnchor": (1.0, 1.0, 1.0, 1.0),
    "FlatBlack": (0.1, 0.1, 0.1, 1.0),
    "Black": (0.0, 0.0, 0.0, 1.0),
    "Red RedGlow LightOff": (1.0, 0.0, 0.0, 1.0),
    "RedBright": (0.87, 0.26, 0.07, 1.0),
    "Green GreenGlow LightOn": (0.0, 1.0, 0.0, 1.0),
    "Blue BlueGlow SkyBlue": (0.0, 0.0, 1.0, 1.0),
    "Yellow YellowGlow": (1.0, 1.0, 0.0, 1.0),
    "ZincYellow": (0.9725, 0.9529, 0.2078, 1.0),
    "DarkYellow": (0.7, 0.7, 0.0, 1.0),
    "Purple PurpleGlow": (1.0, 0.0, 1.0, 1.0),
    "Turquoise TurquoiseGlow TurquoiseGlowOutline": (0.0, 1.0, 1.0, 1.0),
    "Orange": (1.0, 0.5088, 0.0468, 1.0),
    "Indigo": (0.33, 0.0, 0.5, 1.0),
    "Gold": (0.8, 0.64869, 0.120759, 1.0),
    "RedTransparent RedTransparentOverlay": (1.0, 0.0, 0.0, 0.5),
    "GreenTransparent GreenTransparentOverlay": (0.0, 1.0, 0.0, 0.5),
    "BlueTransparent BlueTransparentOverlay": (0.0, 0.0, 1.0, 0.5),
    "YellowTransparent": (1.0, 1.0, 0.0, 0.5),
    "GreyTransparent": (0.5, 0.5, 0.5, 0.5),
    "BlackTransparent": (0.0, 0.0, 0.0, 0.5),
    "DarkMagentaTransparent": (0.6, 0.0, 0.6, 0.5),
    "OrangeTransparent": (1.0, 0.44, 0.0, 0.4),
    "OrangeTransparentOverlay": (1.0, 0.5088, 0.0468, 0.8),
    "DarkOrangeTransparentOverlay": (0.6, 0.305, 0.028, 0.8),
    "BlueLaser": (0.0, 0.0, 1.0, 0.4),
    "LightBlueLaser": (0.5, 0.5, 1.0, 0.4),
    "PioneerBody": (1.0, 0.0, 0.0, 1.0),
    "Pioneer2Body": (0.681193, 0.000923, 0.000923, 1.0),
    "WoodPallet Wood Bricks WindowFrame BuildingFrame PaintedWall GreyGradientSky CloudySky": (
        1.0,
        1.0,
        1.0,
        1.0,
    ),
    "WoodFloor CeilingTiled Runway Grass CoM": (0.5, 0.5, 0.5, 1.0),
    "Road Residential Tertiary Pedestrian Footway Motorway Lanes_6 "
    "Trunk Lanes_4 Primary Lanes_2 Secondary Lane_1 Steps": (0.8, 0.8, 0.8, 1.0),
}

GAZEBO: dict[str, Color] = {
    f"Gazebo/{name}": color for names, color in _NAMES.items() for name in names.split()
}
"""Gazebo's name of a material -> its colour."""


def read_color(tag: Tag, words: str, source: Source) -> Color | None:
    """Red, green, blue and optionally alpha, each from 0 to 1, in `words` of `tag`; anything else
    causes a warning.
    """
    values = [number(word) for word in words.split()]
    known = [value for value in values if value is not None and 0 <= value <= 1]
    if len(values) not in (3, 4) or len(known) != len(values):
        expected = "red, green, blue and alpha, each from 0 to 1"
        source.warn(tag, f"has the colour {cut(words)}, which is left out; write {expected}")
        return None
    red, green, blue, alpha = (*known, 1.0)[:4]
    return red, green, blue, alpha


def nearest_gazebo(word: str, source: Source) -> str:
    """A suggestion for a misspelt Gazebo material, with or without the prefix Gazebo/; empty if
    none is near.
    """
    return source.suggest(word if "/" in word else f"Gazebo/{word}", GAZEBO)


# Materials of URDF, and those of Gazebo, which take precedence.


Materials = Mapping[str, Color | None]
"""Name -> colour; None for a known material without a colour, such as one with a texture alone."""


def read_materials(robot: Tag, source: Source) -> dict[str, Color | None]:
    """The materials that a `<robot>` defines, directly or in any visual, as in urdfdom's
    model.cpp.
    """
    found: dict[str, Color | None] = {}
    for tag in robot.all("material"):
        name = tag.attributes.get("name", "")
        if name in found:
            source.warn(tag, "is defined twice; the first is used")
        else:
            found[name] = _plain_color(tag, source)
    quiet = Source(source.origin, source.packages)  # mistakes are reported when the visual is read
    inside = [
        tag
        for link in robot.all("link")
        for visual in link.all("visual")
        for tag in visual.all("material")
    ]
    for tag in inside:
        name = tag.attributes.get("name", "")
        if name and name not in found and tag.first("color"):
            found[name] = _plain_color(tag, quiet)
    return found


def urdf_color(visual: Tag, materials: Materials, source: Source) -> Color | None:
    """The colour of a URDF `<visual>`: its own, or that of the material it names."""
    tag = visual.first("material")
    if tag is None:
        return None
    name = tag.attributes.get("name", "")
    if name in materials:
        return _plain_color(tag, source) if tag.first("color") else materials[name]
    if name in GAZEBO or not name.strip():
        return GAZEBO.get(name) or _plain_color(tag, source)
    if not tag.first("texture"):
        source.warn(
            tag, f"has no colour, neither here nor in <robot>{source.suggest(name, materials)}"
        )
    return _plain_color(tag, source)


def read_textures(robot: Tag, source: Source) -> dict[str, str]:
    """The images of the materials that a `<robot>` defines, by name, as data: URIs."""
    tags = [tag for tag in robot.all("material") if tag.first("texture") is not None]
    return {tag.attributes.get("name", ""): _own_texture(tag, source) for tag in reversed(tags)}


def urdf_texture(visual: Tag, textures: Mapping[str, str], source: Source) -> str:
    """The image of a URDF `<visual>` as a data: URI: its own, or that of the material it names;
    empty without one.
    """
    tag = visual.first("material")
    if tag is None:
        return ""
    has_own = tag.first("texture") is not None or tag.first("color") is not None
    return (
        _own_texture(tag, source) if has_own else textures.get(tag.attributes.get("name", ""), "")
    )


def _own_texture(tag: Tag, source: Source) -> str:
    # What has a colour to show instead of a missing image is no mistake.
    quiet = (
        Source(source.origin, source.packages, confined=source.confined)
        if tag.first("color")
        else source
    )
    return texture_of(tag, quiet)


def gazebo_texture(gazebo: Tag, source: Source) -> str:
    """The image of the material that a `<gazebo reference="link">` gives; empty without one."""
    found = (tag.first("material") for tag in (gazebo, *gazebo.all("visual")))
    return next((texture_of(material, source) for material in found if material is not None), "")


def gazebo_color(gazebo: Tag, source: Source) -> Color | None:
    """The colour that a `<gazebo reference="link">` gives: `<material>Gazebo/Black</material>`, or
    SDF's `<visual><material>` with `<diffuse>`, `<ambient>` or a `<script>`.
    """
    for tag in (gazebo, *gazebo.all("visual")):
        material = tag.first("material")
        if material is not None:
            return material_color(material, source)
    return None


def material_color(material: Tag, source: Source) -> Color | None:
    """The colour of a `<material>` of Gazebo or SDF."""
    for name in ("diffuse", "ambient"):
        tag = material.first(name)
        if tag is not None:
            return read_color(tag, tag.value(), source)
    script = material.first("script") or material
    tag = script.first("name") or script
    name = tag.value()
    if name and name not in GAZEBO:
        source.warn(
            tag,
            f"names the colour {cut(name)}, which Gazebo does not "
            f"have{nearest_gazebo(name, source)}",
        )
    return GAZEBO.get(name)


def _plain_color(tag: Tag, source: Source) -> Color | None:
    color = tag.first("color")
    return None if color is None else read_color(color, color.attributes.get("rgba", ""), source)


# A box in place of an unusable mesh: the robot still loads, and the gap is visible.


EDGE = 0.1  # m; if the link gives no size
# m; an inertia that implies another size is considered a mistake
SMALLEST_EDGE, LARGEST_EDGE = (1e-3, 2.0)
WIDEST_BOX = 0.3  # m; inertias are often guesses, and too large a box hides the robot

LARGEST_SHAPE = 1e3  # m


def placeholder(tag: Tag, pose: Pose) -> Shape:
    """A box in place of the mesh `tag`. For a visual mesh it is the bounding box of the link's
    largest collision shape, other than a mesh; else the box with the link's mass and moments of
    inertia, at most WIDEST_BOX wide; else a cube.

    In URDF its pose is that of the collision shape or the inertial frame; in SDF, where poses may
    be relative to other frames, and for the cube, it is the shape's own `pose`. A box a, b, c of
    mass m has Ixx = m (b^2 + c^2) / 12, so a^2 = 6 (Iyy + Izz - Ixx) / m. The products of inertia
    are ignored.
    """
    is_visual = _around(tag, "visual") is not None
    link = _around(tag, "link")
    solid = [
        found
        for shape in (link.all("collision") if link and is_visual else ())
        if (found := _box(shape))
    ]
    if solid:
        edges, collision = max(solid, key=lambda found: math.prod(found[0]))
        return Shape("box", edges, _origin(collision) or pose)
    inertial = link.first("inertial") if link else None
    size = None if inertial is None else _box_of_inertia(inertial)
    if inertial is None or size is None:
        return Shape("box", (EDGE, EDGE, EDGE), pose)
    return Shape("box", size, _origin(inertial) or pose)


def _around(tag: Tag | None, name: str) -> Tag | None:
    """The nearest element called `name` that contains `tag`."""
    while tag is not None and tag.name != name:
        tag = tag.parent
    return tag


def _box(collision: Tag) -> tuple[tuple[float, ...], Tag] | None:
    """The edges of the box around a collision shape, and its element; None for a mesh or an invalid
    size.
    """
    geometry = collision.first("geometry")
    for shape in geometry.children if geometry else ():
        if shape.name in SHAPES:
            with suppress(RobotError):
                x, *more = size = read_size(shape)
                if max(size) <= LARGEST_SHAPE:
                    return {"box": size, "cylinder": (2 * x, 2 * x, *more), "sphere": (2 * x,) * 3}[
                        shape.name
                    ], collision
    return None


def _box_of_inertia(inertial: Tag) -> tuple[float, ...] | None:
    inertia = inertial.first("inertia")
    try:
        mass = inertial.number("mass") if inertial.sdf else inertial.needed("mass").number("value")
        moments = (
            [inertia.number(name, most=math.inf) for name in ("ixx", "iyy", "izz")]
            if inertia
            else []
        )
    except RobotError:
        return None
    if not moments or mass <= 0:
        return None
    squares = [6 * (sum(moments) - 2 * moment) / mass for moment in moments]
    if not all(SMALLEST_EDGE**2 <= square <= LARGEST_EDGE**2 for square in squares):
        return None
    return tuple(min(WIDEST_BOX, math.sqrt(square)) for square in squares)


def _origin(tag: Tag) -> Pose | None:
    """The pose of a URDF's inertial or collision frame; None in SDF, and for invalid numbers."""
    try:
        return None if tag.sdf else read_pose(tag)
    except RobotError:
        return None


# Visual and collision elements.


MAX_MESHES = 200  # in a text received over the network: each takes up to 1 ms of the sim's loop
MAX_BYTES = 5_000_000  # of a file that such a text refers to: 0.3 s
SMALLEST = 1e-6  # of a size in metres, and of a mesh's scale

SHAPES = ("box", "cylinder", "sphere")  # of URDF
SIZES = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "cone": {"radius": 1, "length": 1},
    "ellipsoid": {"radii": 3},
    "plane": {"size": 2},
}
"""The values that give a shape's size, and how many numbers each contains."""


def read_shape(tag: Tag, source: Source, fixed: bool = False) -> Shape:
    """A `<visual>` or `<collision>`; `fixed` as for `mesh_shape`. Raises RobotError."""
    shape = geometry_of(tag, SHAPES)
    pose = read_pose(tag, FARTHEST if tag.name == "visual" else LARGEST)
    if shape.name == "mesh":
        return mesh_shape(shape, shape.word("filename"), pose, tag.name, source, fixed=fixed)
    return Shape(shape.name, read_size(shape), pose)


def geometry_of(tag: Tag, shapes: Iterable[str], others: Iterable[str] = ()) -> Tag:
    """The first element in the `<geometry>` of a visual or collision that is one of the `shapes`, a
    mesh, or one of `others`. Raises RobotError, which names the shapes.
    """
    geometry = tag.needed("geometry")
    for child in geometry.children:
        if child.name in (*shapes, "mesh", *others):
            return child
    found = ", ".join(f"<{child.name[:80]}>" for child in geometry.children[:12]) or "nothing"
    raise geometry.wrong(f"contains {found}; it must contain {tags(shapes)} or <mesh>")


def tags(names: Iterable[str]) -> str:
    """Names of elements, as they are written."""
    return ", ".join(f"<{name}>" for name in names)


def mesh_shape(
    tag: Tag,
    uri: str,
    pose: Pose,
    use: str,
    source: Source,
    color: Color | None = None,
    fixed: bool = False,
) -> Shape:
    """The mesh that `uri` names, for a visual or collision (`use`) of a link around `tag`, in URDF
    or SDF. `fixed`: it never moves, so that a concave one collides as it is.

    A collision mesh is read, a visual one only located. A missing or invalid mesh is replaced by a
    box, with a warning; with `source.strict` it raises RobotError. The visual meshes of a text
    received over the network are not looked up; embedded ones are kept unread.
    """
    scale = tag.vector("scale", (1.0, 1.0, 1.0))
    if min(abs(factor) for factor in scale) < SMALLEST:
        x, y, z = (math.copysign(max(abs(factor), SMALLEST), factor) for factor in scale)
        source.warn(
            tag,
            f"({use}) has the scale {scale}; a zero flattens the mesh (a negative scale mirrors "
            "it)",
        )
        scale = x, y, z
    if use == "visual" and source.confined:
        return Shape("mesh", scale, pose, color=color, data=uri.strip() if is_data(uri) else "")
    try:
        shape = _found(tag, uri, scale, pose, use, source)
        if fixed and use == "collision":
            shape = _as_it_is(shape, tag, uri, scale, source)
    except RobotError as error:
        if source.strict:
            raise tag.wrong(f"({use}): {error}") from None
        shape = placeholder(tag, pose)
        size = " x ".join(f"{edge:.3g}" for edge in shape.size)
        source.warn(tag, f"({use}) is replaced by a box of {size} m: {error}")
    return replace(shape, color=color)


def _as_it_is(shape: Shape, tag: Tag, uri: str, scale: Vector, source: Source) -> Shape:
    """The collision mesh with its triangles, unless it is convex, or has too many: then its hull
    collides.
    """
    try:
        found = triangles_of(shape.path, scale) if shape.path else data_triangles(uri, scale)
    except RobotError as error:
        source.warn(tag, f"(collision) collides as its convex hull: {error}")
        return shape
    return replace(shape, triangles=found)


def _found(tag: Tag, uri: str, scale: Vector, pose: Pose, use: str, source: Source) -> Shape:
    source.meshes += 1
    if source.confined and source.meshes > MAX_MESHES:
        raise RobotError(
            f"is mesh number {source.meshes}; the sim reads at most {MAX_MESHES} collision meshes"
        )
    if is_data(uri):
        return Shape("hull", (), pose, points=data_hull(uri, scale))
    path = resolve_uri(
        uri,
        source.origin,
        source.packages,
        source.confined,
        lambda taken: source.warn(tag, f"({use}): {taken}"),
    )
    if use == "collision":
        if source.confined and os.path.getsize(path) > MAX_BYTES:
            raise RobotError(
                f"{path}: is too large to be read by the sim; send the mesh itself (holozen spawn "
                "does)"
            )
        return Shape("mesh", scale, pose, path, points=hull(path, scale))
    return Shape("mesh", scale, pose, path, data=mesh_uri(path, source))


def read_pose(tag: Tag, most: float = LARGEST) -> Pose:
    """The pose of an `<origin>`, at most `most` m away; without one it is the parent's frame."""
    origin = tag.first("origin")
    zero = (0.0, 0.0, 0.0)
    if origin is None:
        return Pose()
    x, y, z = origin.numbers("xyz", 3, zero, most)
    return Pose((x, y, z), origin.vector("rpy", zero))


def read_size(tag: Tag, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
    """The size of a shape in metres, its values in the order of SIZES. Raises RobotError."""
    size = tuple(
        value
        for name, count in SIZES[tag.name].items()
        for value in tag.numbers(name, count, default)
    )
    if min(size) < SMALLEST:
        raise tag.wrong(f"has the size {size} m; each number must be {SMALLEST:g} or more")
    return size
