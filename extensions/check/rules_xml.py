"""Misspelt and misplaced elements and attributes, which parsers silently ignore, and values that
are not numbers.
"""

import math
import re
from collections.abc import Iterator, Mapping

from msgspec import Struct

from holozen.check.mistake import Edit, Mistake
from holozen.check.rule import rule
from holozen.check.spelling import is_clear, nearest
from holozen.check.subject import Subject, split
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import LARGEST, Tag
from holozen.robot.files.gazebo_plugins import drive_tags
from holozen.robot.files.sdf import IN_WORLD, NOT_SIMULATED
from holozen.robot.files.sdf import KNOWN as KNOWN_IN_SDF
from holozen.robot.model import JOINT_KINDS
from holozen.suggest import cut, listed

# The words of URDF, of its Gazebo elements, and of SDF.


class Words(Struct, frozen=True):
    """The allowed contents of an element."""

    attributes: frozenset[str]
    children: frozenset[str]


def _set(text: str) -> frozenset[str]:
    return frozenset(text.split())


def _in_both_spellings(names: frozenset[str]) -> frozenset[str]:
    """The names in snake_case, as in ROS 2 and gz-sim, and in camelCase, as in ROS 1."""
    return names | {re.sub("_(.)", lambda found: found[1].upper(), name) for name in names}


def _words(attributes: str, children: str = "") -> Words:
    return Words(_set(attributes), _set(children))


URDF = {
    "robot": _words("name version", "link joint material gazebo transmission ros2_control sensor"),
    "link": _words("name type", "inertial visual collision gravity"),
    "inertial": _words("", "origin mass inertia"),
    "origin": _words("xyz rpy quat_xyzw"),
    "mass": _words("value"),
    "inertia": _words("ixx ixy ixz iyy iyz izz"),
    "visual": _words("name", "origin geometry material"),
    "collision": _words("name group", "origin geometry material"),
    "geometry": _words("", "box cylinder sphere mesh capsule"),
    "box": _words("size"),
    "cylinder": _words("radius length"),
    "capsule": _words("radius length"),
    "sphere": _words("radius"),
    "mesh": _words("filename scale"),
    "material": _words("name", "color texture"),
    "color": _words("rgba"),
    "texture": _words("filename"),
    "joint": _words(
        "name type", "origin parent child axis limit dynamics calibration mimic safety_controller"
    ),
    "parent": _words("link"),
    "child": _words("link"),
    "axis": _words("xyz"),
    "limit": _words("lower upper effort velocity acceleration deceleration jerk"),
    "dynamics": _words("damping friction"),
    "calibration": _words("rising falling reference_position"),
    "mimic": _words("joint multiplier offset"),
    "safety_controller": _words("soft_lower_limit soft_upper_limit k_position k_velocity"),
    "gazebo": _words("reference"),
    "transmission": _words("name type"),
}
"""Elements of URDF; the contents of <gazebo> and <transmission> are not listed."""

MISPLACED = {
    name: [owner for owner, words in URDF.items() if name in words.children]
    for name in _set(
        """origin mass inertia geometry inertial visual collision axis limit parent child mimic dynamics link joint
        box cylinder sphere mesh color"""  # noqa: E501
    )
} | {"plugin": ["gazebo"]}
"""Element -> the elements that it belongs in; parsers silently ignore it anywhere else."""

IGNORED = {
    "include": 'write <xacro:include filename="..."/>',
    "surface": 'write <gazebo reference="LINK"> with <mu1> and <mu2> in it, next to the links',
    "pose": 'write <origin xyz="..." rpy="..."/> in the joint, inertial, visual or collision',
    "joint_properties": 'write <dynamics damping="..." friction="..."/>',
    "self_collide": 'write <gazebo reference="LINK"><selfCollide>true</selfCollide></gazebo>',
}
"""Elements of SDF and of older URDF often found in URDF, and what to write instead."""

GAZEBO = _set(
    """material mu mu1 mu2 kp kd fdir1 selfCollide self_collide maxVel minDepth maxContacts
    max_contacts laserRetro turnGravityOff gravity dampingFactor implicitSpringDamper
    provideFeedback springStiffness springReference stopCfm stopErp fudgeFactor
    preserveFixedJoint disableFixedJointLumping sensor plugin visual collision static pose
    canonical_body joint link light ode surface friction"""
)
"""Elements in <gazebo>, which may contain others too."""

PLUGIN = _set("broadcastTF publishOdomTF publishWheelTF") | _in_both_spellings(
    drive_tags()
    | _set(
        """always_on angular body_name camera_info_topic_name camera_name control_period dimensions
        force_frame frame_name image_topic_name initial_position joint_name linear link_name
        namespace parameters publish_wheel_joint_state publish_wheel_tf rear_left_joint
        rear_right_joint remapping robot_base_link robot_param robot_sim_type ros ros_debug_level
        rpy_offset rpy_offsets service_name tf_topic topic_name xyz_offset xyz_offsets"""
    )
)
"""Elements in a <plugin>, in the spelling of ROS 1, ROS 2 and gz-sim: those of drives, and others
of Gazebo; a plugin may have more.
"""

SDF = frozenset(KNOWN_IN_SDF).union(
    IN_WORLD, NOT_SIMULATED, *(map(_set, KNOWN_IN_SDF.values()))
) | _set(
    """sdf world uri name box size cylinder radius length sphere mesh scale plane normal capsule
    ellipsoid radii polyline heightmap empty submesh center metal metallic roughness albedo_map
    normal_map metalness_map roughness_map ode bullet torsional mu mu2 fdir1 slip1 slip2 kp kd
    soft_cfm soft_erp max_vel min_depth restitution_coefficient threshold collide_bitmask
    category_bitmask collide_without_contact collide_without_contact_bitmask always_on
    update_rate visualize topic camera ray lidar imu gps altimeter magnetometer noise type mean
    stddev bias_mean bias_stddev image width height format horizontal_fov clip near far
    distortion scan horizontal vertical samples resolution min_angle max_angle range min max
    linear angular direction attenuation constant quadratic spot inner_angle outer_angle falloff
    max_step_size real_time_factor real_time_update_rate solver iters sor cfm erp background
    shadows sky grid provide_feedback cfm_damping implicit_spring_damper suspension
    sensor_frame_id optical_frame_id gz_frame_id ignition_frame_id anti_aliasing cascade
    has_force_control"""
)
"""Elements of SDF: those that the loader knows, and those inside them."""

# Spelling.


MAX_GUESSES = 500  # of different words
FREE = ("gazebo", "transmission")  # may contain non-URDF elements
SEVERAL = ("visual", "collision")  # a link may have more than one of each
SDF_JOINT_KINDS = (*JOINT_KINDS, "revolute2", "universal", "ball", "screw", "gearbox")


@rule("xml", "warning", "broken XML that Gazebo tolerates", "ROS and other parsers reject it")
def _forgiven(subject: Subject) -> Iterator[Mistake]:
    yield from subject.forgiven


@rule("tag", "error", "a misspelt element", "it is silently ignored")
def _misspelt_tags(subject: Subject) -> Iterator[Mistake]:
    """Unknown elements similar to one allowed in their place."""
    guessed: dict[tuple[str, frozenset[str]], str | None] = {}
    for tag, known, shortest in _read_elements(subject):
        if tag.name in known or ":" in tag.name or len(guessed) > MAX_GUESSES:
            continue
        if (tag.name, known) not in guessed:
            guessed[tag.name, known] = nearest(tag.name, known, shortest)
        suggestion = guessed[tag.name, known]
        if shortest >= 4 and suggestion and tag.name.startswith(suggestion):
            continue  # another word with the same beginning, as some plugin may have
        if not suggestion:
            continue
        fix = f"write <{suggestion}>"
        edit = (
            Edit("element", tag.name, suggestion) if is_clear(tag.name, suggestion, known) else None
        )
        if suggestion.lower() != tag.name.replace("_", "").lower():
            yield Mistake(tag, f"there is no element <{tag.name}>", fix, edit)
        elif shortest < 4:
            yield Mistake(
                tag, f"<{tag.name}> is not <{suggestion}>: case and underscores matter", fix, edit
            )


@rule("attribute", "error", "a misspelt attribute", "it is silently ignored")
def _misspelt_attributes(subject: Subject) -> Iterator[Mistake]:
    """Unknown attributes of URDF elements similar to a known one."""
    for tag in _urdf_elements(subject):
        given = set(tag.attributes)
        known = URDF[tag.name].attributes
        for word in sorted(given - known):
            # Prefer a word that the element does not have yet.
            suggestion = (
                None
                if ":" in word
                else nearest(word, sorted(known - given)) or nearest(word, sorted(known))
            )
            if suggestion:
                sure = suggestion not in given and is_clear(word, suggestion, known - given)
                edit = Edit("attribute", word, suggestion, tag.name) if sure else None
                yield Mistake(tag, f"{tag} has no attribute {word!r}", f"write {suggestion}=", edit)


@rule("place", "error", "an element in a place where it is not read", "it is silently ignored")
def _misplaced(subject: Subject) -> Iterator[Mistake]:
    for parent in _urdf_elements(subject):
        for tag in parent.children if parent.name not in FREE else ():
            if tag.name in MISPLACED and tag.name not in URDF[parent.name].children:
                owners = " or ".join(f"<{name}>" for name in MISPLACED[tag.name])
                yield Mistake(
                    tag, f"<{tag.name}> does not belong in {parent}", f"move it into {owners}"
                )


@rule("ignored", "warning", "an element that URDF does not have, or text", "URDF parsers ignore it")
def _ignored(subject: Subject) -> Iterator[Mistake]:
    """Except misspellings of elements that URDF has there. Of elements that are there once the
    first counts.
    """
    spelt = {mistake.at for mistake in _misspelt_tags.find(subject)}
    macros = {
        tag.attributes.get("name")
        for source in subject.sources
        for tag in source.root.all("xacro:macro")
    }
    for parent in _urdf_elements(subject):
        known = URDF[parent.name].children
        if parent.name not in FREE and (text := parent.text.strip()):
            yield Mistake(
                parent, f"the text {cut(text, 40)} in {parent} is not read", _as_attribute(parent)
            )
        for tag in _further(parent):
            yield Mistake(
                tag, f"a second {_kind(tag)} in {parent} is not read", "remove one of them"
            )
        for tag in parent.children if parent.name not in FREE else ():
            if tag.name in known or tag.name in MISPLACED or ":" in tag.name or tag in spelt:
                continue
            fix = IGNORED.get(
                tag.name,
                f"remove it, or write one of {listed(sorted(known))}" if known else "remove it",
            )
            fix = f"write <xacro:{tag.name}> to call the macro" if tag.name in macros else fix
            yield Mistake(tag, f"<{tag.name}> in {parent} is not read", fix)


def _as_attribute(tag: Tag) -> str:
    """What to write in place of an element's text."""
    words = [f'{word}="..."' for word in sorted(URDF[tag.name].attributes - {"quat_xyzw"})]
    return f"write {' or '.join(words)}" if words and not URDF[tag.name].children else "remove it"


def _further(parent: Tag) -> Iterator[Tag]:
    """The children of an element of which it has one alone, but for the first."""
    seen: set[str] = set()
    for tag in parent.children if parent.name not in ("robot", *FREE) else ():
        if tag.name in URDF[parent.name].children and tag.name not in SEVERAL:
            if _kind(tag) in seen:
                yield tag
            seen.add(_kind(tag))


def _kind(tag: Tag) -> str:
    return "shape" if tag.parent and tag.parent.name == "geometry" else f"<{tag.name}>"


@rule("joint-type", "error", "a joint type that does not exist", "the robot cannot be loaded")
def _joint_kinds(subject: Subject) -> Iterator[Mistake]:
    kinds = SDF_JOINT_KINDS if subject.sdf else JOINT_KINDS
    for tag in subject.root.all("joint"):
        kind = tag.attributes.get("type")
        if kind is not None and kind not in kinds:
            suggestion = nearest(kind, kinds)
            fix = f'write type="{suggestion}"' if suggestion else f"write one of {', '.join(kinds)}"
            yield Mistake(tag, f"{tag} has unknown type {kind!r}", fix)


@rule("number", "error", "a value that is not a number", "the robot cannot be loaded")
def _bad_numbers(subject: Subject) -> Iterator[Mistake]:
    """Values of links and joints that are no finite numbers, or not as many as needed; axes without
    direction.
    """
    for tag in _outside_plugins(subject.root) if subject.sdf else _urdf_elements(subject):
        most = math.inf if tag.name == "limit" else LARGEST
        for name, count in NUMBERS.get(tag.name, {}).items():
            try:
                tag.numbers(name, count, (0.0,) * count, most)
                if tag.name == "axis" and not (
                    tag.parent and tag.parent.attributes.get("type") in UNMOVED
                ):
                    tag.direction(name, (1.0, 0.0, 0.0))
            except RobotError as error:
                problem, _, fix = split(str(error), subject.path)[1].partition("; ")
                yield Mistake(tag, problem, fix or f"write {count}, with spaces between them")


_MOMENTS = dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1)
NUMBERS: Mapping[str, Mapping[str, int]] = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "inertia": _MOMENTS,
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
    "dynamics": {"damping": 1, "friction": 1},
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "mimic": {"multiplier": 1, "offset": 1},
}
"""How many numbers a value of an element has: an attribute in URDF, a child in SDF. Masses have a
rule of their own.
"""
UNMOVED = ("fixed", "floating")  # joints whose axis is not read


def _read_elements(subject: Subject) -> Iterator[tuple[Tag, frozenset[str], int]]:
    """Each element with the words allowed in its place, and the minimum length of a word for
    suggestions.
    """
    if subject.sdf:
        yield from (
            (tag, SDF, 4) for tag in _outside_plugins(subject.root) if tag.name not in MISPLACED
        )
    for parent in _urdf_elements(subject):
        if parent.name not in FREE:
            yield from (
                (tag, URDF[parent.name].children, 3)
                for tag in parent.children
                if tag.name not in URDF
            )
    for gazebo in subject.root.all("gazebo") if not subject.sdf else ():
        yield from ((tag, GAZEBO, 4) for tag in gazebo.children)
    yield from ((tag, PLUGIN, 6) for tag in subject.settings)


def _urdf_elements(subject: Subject) -> Iterator[Tag]:
    """The elements of URDF in their place; none for SDF. The contents of <gazebo> and
    <transmission> are left out.
    """
    waiting = [] if subject.sdf else [subject.root]
    while waiting:
        tag = waiting.pop()
        yield tag
        known = URDF[tag.name].children  # none for those two
        waiting += [
            child for child in reversed(tag.children) if child.name in known and child.name in URDF
        ]


def _outside_plugins(root: Tag) -> Iterator[Tag]:
    waiting = [root]
    while waiting:
        tag = waiting.pop()
        yield tag
        if tag.name != "plugin":
            waiting += tag.children[::-1]
