"""URDF: a `<robot>` with its links, joints, materials and `<gazebo>` elements -> RobotModel."""

import math
from collections.abc import Callable, Mapping
from typing import TypeVar

from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Source, Tag
from holozen.robot.files.gazebo_plugins import Settings, read_forces, read_plugins, warn_unseen
from holozen.robot.files.inertial import check_drive, read_inertia, warn_massless, with_moments
from holozen.robot.files.sensors import read_sensors
from holozen.robot.files.shapes import (
    Materials,
    gazebo_color,
    gazebo_texture,
    read_materials,
    read_pose,
    read_shape,
    read_textures,
    urdf_color,
    urdf_texture,
)
from holozen.robot.inertia import NO_INERTIA, massless, without
from holozen.robot.model import (
    JOINT_KINDS,
    MAX_PARTS,
    Inertial,
    Joint,
    Limits,
    Link,
    Mimic,
    RobotModel,
    Shape,
    Surface,
    Vector,
    descend,
)
from holozen.suggest import cut, listed

# The tree of links and joints.


def root_of(robot: Tag, links: Mapping[str, object], joints: Mapping[str, Joint]) -> str:
    """The only link that is not a joint's child. Raises RobotError unless links and joints form one
    tree.
    """
    tags = {tag.word("name"): tag for tag in robot.all("joint")}
    _check_ends(tags, links, joints)
    parents = _parents(tags, joints)
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        raise robot.wrong(
            f"has {len(roots)} root links: {listed(roots)}; attach all but one to another link "
            "with a joint"
        )
    reached = {*roots, *(joint.child for root in roots for joint in descend(root, joints))}
    lost = [name for name in links if name not in reached]
    if lost:
        raise robot.wrong(
            f"has joints that form a loop through the links {listed(lost)}; remove one joint"
        )
    return roots[0]


def _check_ends(
    tags: Mapping[str, Tag], links: Mapping[str, object], joints: Mapping[str, Joint]
) -> None:
    for joint in joints.values():
        for end, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in links:
                known = listed(links)
                raise tags[joint.name].wrong(
                    f"names the unknown {end} link {cut(name)}; links: {known}"
                )


def _parents(tags: Mapping[str, Tag], joints: Mapping[str, Joint]) -> dict[str, str]:
    """Child link -> its parent joint."""
    parents: dict[str, str] = {}
    for joint in joints.values():
        other = parents.setdefault(joint.child, joint.name)
        if other != joint.name:
            raise tags[joint.name].wrong(
                f"has the child link {cut(joint.child)}, which is already the child of joint "
                f"{cut(other)}"
            )
    return parents


def check_mimics(robot: Tag, joints: Mapping[str, Joint], source: Source) -> None:
    """Raise RobotError for a joint that mimics a missing joint, or itself, directly or through
    others.
    """
    followed = {joint.name: joint.mimic.joint for joint in joints.values() if joint.mimic}
    for name, other in followed.items():
        if other not in joints:
            near = source.suggest(other, joints)
            problem = f"follows the joint {cut(other)}, which does not exist{near}"
            raise _wrong(robot, name, f"{problem}; joints: {listed(joints)}")
    done: set[str] = set()
    for start in followed:
        path: dict[str, None] = {}
        name = start
        while name in followed and name not in done:
            if name in path:
                circle = list(path)[list(path).index(name) :]
                raise _wrong(
                    robot, name, f"follows itself in a loop through the joints {listed(circle)}"
                )
            path[name] = None
            name = followed[name]
        done.update(path)


def _wrong(robot: Tag, name: str, problem: str) -> RobotError:
    joint = next(tag for tag in robot.all("joint") if tag.word("name") == name)
    return (joint.first("mimic") or joint).wrong(problem)


def warn_transmissions(robot: Tag, joints: Mapping[str, Joint], source: Source) -> None:
    """Warn about transmissions that name no joint of the robot. Joints take commands without a
    transmission.
    """
    for tag in robot.all("transmission"):
        names = [joint.attributes.get("name", "").strip() for joint in tag.all("joint")]
        unknown = [name for name in names if name not in joints]
        if unknown:
            near = source.suggest(unknown[0], joints)
            source.warn(
                tag,
                f"names the joint {cut(unknown[0])}, which does not exist{near}; it is left out",
            )
        elif not names:
            source.warn(tag, "names no joint; it is left out")


# `<gazebo>` elements.


CONTACT = ("mu", "mu1", "mu2", "kp", "kd")
STIFFEST = 1e18  # N/m; Gazebo's own default is 1e12


def read_gazebo(
    robot: Tag, links: Mapping[str, Link], joints: Mapping[str, Joint], source: Source
) -> tuple[dict[str, Link], bool]:
    """The links with the settings of their `<gazebo reference="...">`, and whether the robot is
    static.

    A later element overrides an earlier one, and a material here overrides URDF's, as in sdformat's
    parser_urdf.cc. Raises RobotError.
    """
    changed, static = dict(links), False
    for tag in robot.all("gazebo"):
        name = tag.attributes.get("reference", "").strip()
        if not name:
            static = Settings(tag).flag("static", default=static)
        elif name in changed:
            changed[name] = _with_settings(changed[name], tag, source)
        elif name not in joints:
            near = source.suggest(name, (*links, *joints))
            problem = f"names no link and no joint{near}; it is left out"
            source.warn(tag, f"{problem}; links: {listed(links)}")
    return changed, static


def _with_settings(link: Link, tag: Tag, source: Source) -> Link:
    settings = Settings(_with_contact(tag))
    texture = gazebo_texture(tag, source)
    color = None if texture else gazebo_color(tag, source)
    look = {name: value for name, value in (("texture", texture), ("color", color)) if value}
    # Two spellings: <gravity>0</gravity> of SDF, and the older <turnGravityOff>.
    is_off = settings.flag("turn_gravity_off", default=not link.gravity)
    return replace(
        link,
        surface=_surface(link.surface, settings),
        gravity=settings.flag("gravity", default=not is_off),
        visuals=tuple(replace(shape, **look) for shape in link.visuals) if look else link.visuals,
    )


def _surface(before: Surface, settings: Settings) -> Surface:
    values = {
        "mu1": settings.optional("mu1", "mu", most=math.inf),
        "mu2": settings.optional("mu2", "mu", most=math.inf),
        "kp": settings.optional("kp", most=STIFFEST),
        "kd": settings.optional("kd", most=STIFFEST),
    }
    given = {name: value for name, value in values.items() if value is not None}
    self_collide = settings.flag("self_collide", default=before.self_collide)
    return replace(before, self_collide=self_collide, **given)


def _with_contact(tag: Tag) -> Tag:
    """The element with SDF's `<collision><surface>...<mu>` and so on as direct children."""
    inside = [
        deep
        for collision in tag.all("collision")
        for name in CONTACT
        for deep in collision.below(name)
    ]
    return replace(tag, children=[*tag.children, *inside]) if inside else tag


# Links and joints.


WORLD = "world"  # a root of this name is the ground: Gazebo fixes the robot to it
Part = TypeVar("Part", Link, Joint)


def read_robot(robot: Tag, source: Source) -> RobotModel:
    """A `<robot>`. Raises RobotError."""
    materials, textures = read_materials(robot, source), read_textures(robot, source)
    fixed = is_static(robot)
    links = _by_name(robot, "link", lambda tag: read_link(tag, source, materials, textures, fixed))
    joints = _by_name(robot, "joint", lambda tag: read_joint(tag, source))
    if not links:
        raise robot.wrong("has no <link>; a robot has at least one")
    root = root_of(robot, links, joints)
    check_mimics(robot, joints, source)
    all_links, static = read_gazebo(robot, links, joints, source)
    lost = massless(links, joints, root)
    warn_massless(robot, links, joints, lost, source)
    kept, kept_joints = without(all_links, joints, lost)
    drive, forces = read_forces(
        robot, kept, root, read_plugins(robot, kept, joints, root, source), source
    )
    check_drive(robot, drive, links, joints, root, lost, source)
    sensors = read_sensors(robot, kept, links, source)
    warn_unseen(robot, drive, sensors, source)
    warn_transmissions(robot, joints, source)
    return RobotModel(
        name=robot.word("name"),
        root=root,
        links=kept,
        joints=kept_joints,
        drive=drive,
        static=static or root == WORLD,
        warnings=tuple(source.warnings),
        forces=forces,
        sensors=tuple(sensors),
    )


def _by_name(robot: Tag, name: str, read: Callable[[Tag], Part]) -> dict[str, Part]:
    tags = robot.all(name)
    if len(tags) > MAX_PARTS:
        raise robot.wrong(
            f"has {len(tags)} {name}s; a robot has at most {MAX_PARTS} links and {MAX_PARTS} joints"
        )
    parts: dict[str, Part] = {}
    for tag in tags:
        part = read(tag)
        if part.name in parts:
            raise tag.wrong("is defined twice; give each a unique name")
        parts[part.name] = part
    return parts


def is_static(robot: Tag) -> bool:
    """Whether a `<gazebo>` of a `<robot>` makes it static. Raises RobotError."""
    own = [
        Settings(tag)
        for tag in robot.all("gazebo")
        if not tag.attributes.get("reference", "").strip()
    ]
    given = [settings.flag("static") for settings in own if settings.word("static")]
    return bool(given) and given[-1]


def read_link(
    tag: Tag,
    source: Source,
    materials: Materials = {},
    textures: Mapping[str, str] = {},
    fixed: bool = False,
) -> Link:
    """A `<link>`; `materials` and `textures` are those of its robot, which never moves if it is
    `fixed`. Raises RobotError.
    """
    inertial = tag.first("inertial")
    link = Link(
        name=tag.word("name"),
        inertial=None if inertial is None else _inertial(inertial),
        visuals=tuple(_visual(visual, source, materials, textures) for visual in tag.all("visual")),
        collisions=tuple(
            read_shape(collision, source, fixed) for collision in tag.all("collision")
        ),
        gravity=Settings(tag).flag("gravity"),  # SDF's, which people write into a URDF too
    )
    return with_moments(link, inertial, source)


def read_joint(tag: Tag, source: Source) -> Joint:
    """A `<joint>`. Raises RobotError."""
    kind = tag.word("type")
    if kind not in JOINT_KINDS:
        raise tag.wrong(f"has unknown type {cut(kind)}; known types: {', '.join(JOINT_KINDS)}")
    parent, child = (tag.needed(end).word("link") for end in ("parent", "child"))
    axis, limits, pose = _axis(tag, kind), _limits(tag, kind, source), read_pose(tag)
    return Joint(
        tag.word("name"),
        kind,
        parent,
        child,
        pose,
        axis,
        limits,
        *read_dynamics(tag),
        read_mimic(tag),
    )


def _visual(tag: Tag, source: Source, materials: Materials, textures: Mapping[str, str]) -> Shape:
    shape = read_shape(tag, source)
    color, texture = urdf_color(tag, materials, source), urdf_texture(tag, textures, source)
    return (
        replace(shape, color=color or shape.color, texture=texture) if color or texture else shape
    )


def read_dynamics(owner: Tag) -> tuple[float, float]:
    """Friction and damping of a URDF joint, or an SDF axis. Raises RobotError."""
    dynamics = owner.child("dynamics")
    friction, damping = (dynamics.number(name, 0.0) for name in ("friction", "damping"))
    if min(friction, damping) < 0:
        raise dynamics.wrong(
            f"has friction {friction} and damping {damping}; a negative one would drive the joint"
        )
    return friction, damping


def read_mimic(owner: Tag) -> Mimic | None:
    """The joint that a URDF joint, or an SDF axis, follows; None if it follows none. Raises
    RobotError.
    """
    mimic = owner.first("mimic")
    if mimic is None:
        return None
    multiplier = mimic.number("multiplier", 1.0)
    offset = mimic.number("offset", 0.0) - (
        multiplier * mimic.number("reference", 0.0) if mimic.sdf else 0.0
    )
    return Mimic(mimic.word("joint"), multiplier, offset)


def _inertial(tag: Tag) -> Inertial:
    mass = tag.needed("mass").number("value")
    if mass < 0:
        raise tag.needed("mass").wrong(f"value: {mass} kg is negative")
    return Inertial(read_pose(tag), mass, read_inertia(tag) if mass else NO_INERTIA)


def _axis(tag: Tag, kind: str) -> Vector:
    axis = tag.first("axis")
    forward = (1.0, 0.0, 0.0)
    return (
        forward if axis is None or kind in ("fixed", "floating") else axis.direction("xyz", forward)
    )


def _limits(tag: Tag, kind: str, source: Source) -> Limits:
    limit = tag.first("limit")
    bounded = kind in ("revolute", "prismatic")
    if limit is None:
        if bounded:
            source.warn(tag, f"is {kind} and has no <limit>; it is treated as unlimited")
        return Limits()
    effort, velocity = (_most(limit, name, source) for name in ("effort", "velocity"))
    if not bounded:
        return Limits(effort, velocity)
    # URDF: a position bound that is left out is 0.
    lower, upper = (limit.number(name, 0.0, most=math.inf) for name in ("lower", "upper"))
    if lower > upper:
        raise limit.wrong(f"has lower={lower} above upper={upper}")
    return Limits(effort, velocity, lower, upper)


def _most(limit: Tag, name: str, source: Source) -> float:
    value = limit.number(name, math.inf, most=math.inf)
    if value < 0:
        source.warn(limit, f"{name}: {value:g} is negative; it is treated as unlimited")
        return math.inf
    return value
