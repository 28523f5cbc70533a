"""The elements that SDF has, so that a misspelt one is told and not passed over."""

from holozen.robot.source import Source
from holozen.robot.tag import Tag

_PHYSICAL = "pose frame plugin sensor"

KNOWN = {
    "model": f"{_PHYSICAL} static self_collide allow_auto_disable enable_wind link joint model include gripper"
    " placement_frame",
    "link": f"{_PHYSICAL} inertial collision visual self_collide gravity kinematic enable_wind must_be_base_link"
    " velocity_decay light projector battery particle_emitter audio_source audio_sink",
    "inertial": "pose frame mass inertia density fluid_added_mass",
    "inertia": "ixx ixy ixz iyy iyz izz",
    "visual": f"{_PHYSICAL} geometry material transparency cast_shadows laser_retro visibility_flags meta",
    "collision": f"{_PHYSICAL} geometry surface max_contacts laser_retro density auto_inertia_params",
    "material": "ambient diffuse specular emissive shininess script shader lighting pbr double_sided render_order",
    "joint": f"{_PHYSICAL} parent child axis axis2 physics thread_pitch screw_thread_pitch gearbox_ratio"
    " gearbox_reference_body",
    "axis": "xyz limit dynamics mimic initial_position use_parent_model_frame",
    "limit": "lower upper effort velocity stiffness dissipation",
    "dynamics": "damping friction spring_reference spring_stiffness",
    "surface": "friction contact bounce soft_contact",
}
"""Element -> what may stand in it; of elements that are not here anything may."""

WORLD = (
    "model include light physics gravity frame gui scene state plugin audio wind magnetic_field atmosphere"
    " spherical_coordinates"
)
NOT_SIMULATED = "actor population road joint"


def check_known(tag: Tag, source: Source, told: set[str]) -> None:
    """Warns of elements that SDF does not have, inside `tag` and below; of each once, which `told` keeps.

    Elements with a prefix, as `a:b`, are anybody's own.
    """
    known = KNOWN[tag.name].split()
    for child in tag.children:
        if child.name not in known:
            _tell(tag, child, known, source, told)
        elif child.name in KNOWN and child.name != "model":  # a model inside is a matter of its own
            check_known(child, source, told)


def check_world(tag: Tag, source: Source, told: set[str]) -> None:
    """As `check_known`, of the elements directly in a world, and of those that are known and not simulated."""
    for child in tag.children:
        if child.name in NOT_SIMULATED.split():
            source.warn(child, "is not simulated and is left out")
        elif child.name not in WORLD.split():
            _tell(tag, child, WORLD.split(), source, told)


def _tell(outer: Tag, child: Tag, known: list[str], source: Source, told: set[str]) -> None:
    key = f"{outer.name} {child.name}"
    if ":" not in child.name and key not in told:
        told.add(key)
        near = source.nearest(child.name, known)
        source.warn(child, f"is nothing that a <{outer.name}> has in SDF, and is passed over{near}")
