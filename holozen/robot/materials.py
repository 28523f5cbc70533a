"""What colours a robot's visuals: the materials of URDF, and those of Gazebo, which win."""

from collections.abc import Mapping

from holozen.robot.colors import GAZEBO, nearest_gazebo, read_color
from holozen.robot.errors import cut
from holozen.robot.parts import Color
from holozen.robot.source import Source
from holozen.robot.tag import Tag

Materials = Mapping[str, Color | None]
"""Name -> colour; None for a material that is known and has no colour, such as a picture."""


def read_materials(robot: Tag, source: Source) -> dict[str, Color | None]:
    """The materials that a `<robot>` names: under itself, or in any visual, as in urdfdom's model.cpp."""
    found: dict[str, Color | None] = {}
    for tag in robot.all("material"):
        name = tag.attributes.get("name", "")
        if name in found:
            source.warn(tag, "is there twice; the first one counts")
        else:
            found[name] = _own_color(tag, source)
    quiet = Source(source.origin, source.packages)  # who reads the visual tells of its mistakes
    inside = [tag for link in robot.all("link") for visual in link.all("visual") for tag in visual.all("material")]
    for tag in inside:
        name = tag.attributes.get("name", "")
        if name and name not in found and tag.first("color"):
            found[name] = _own_color(tag, quiet)
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
        return GAZEBO.get(name) or _own_color(tag, source)
    if not tag.first("texture"):
        source.warn(tag, f"has no colour, neither here nor under <robot>{source.nearest(name, materials)}")
    return _own_color(tag, source)


def gazebo_color(gazebo: Tag, source: Source) -> Color | None:
    """The colour that a `<gazebo reference="link">` gives: `<material>Gazebo/Black</material>`, or SDF's
    `<visual><material>` with `<diffuse>`, `<ambient>` or a `<script>`.
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
    told = script.first("name") or script
    name = told.value()
    if name and name not in GAZEBO:
        source.warn(told, f"names the colour {cut(name)}, which Gazebo does not know{nearest_gazebo(name, source)}")
    return GAZEBO.get(name)


def _own_color(tag: Tag, source: Source) -> Color | None:
    if tag.first("color") is None and tag.first("texture") is not None:
        source.warn(tag, "is a picture; pictures are not shown, and it has no <color> to show instead")
    return _plain_color(tag, source)


def _plain_color(tag: Tag, source: Source) -> Color | None:
    color = tag.first("color")
    return None if color is None else read_color(color, color.attributes.get("rgba", ""), source)
