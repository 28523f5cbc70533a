"""The links and joints of an SDF model, and of the models inside it -> robots, one for each tree of joints."""

from collections.abc import Mapping
from dataclasses import replace

from holozen.robot.model import RobotModel
from holozen.robot.parts import Joint, Limits, Link, Sensor
from holozen.robot.plugins import read_plugins
from holozen.robot.rigid import Frame
from holozen.robot.sdf.bonds import Bonds
from holozen.robot.sdf.frames import INSIDE, WORLD, Frames
from holozen.robot.sdf.joints import rolls
from holozen.robot.sdf.links import Held, read_link
from holozen.robot.sdf.members import Member
from holozen.robot.sdf.values import flag
from holozen.robot.sensors import read_sensor
from holozen.robot.tag import Tag
from holozen.robot.tree import descend


def build(members: list[Member], frames: Frames) -> list[RobotModel]:
    """The robots that a model makes: the one with its canonical link, then one for each link or tree of links that no
    joint holds on another; a static model is always one.

    The first one's root link is told in the model's own frame, which is its `pose`. A link whose frame is off the axis
    it turns about is told in a frame on the axis. Raises RobotError.
    """
    piece = members[0].piece
    bonds = Bonds.of(members, frames)
    if not bonds.links:
        piece.source.warn(piece.tag, "has no <link> and is left out")
        return []
    static = _static(members)
    first = bonds.root_above(frames.link(piece.tag, WORLD, bonds.top))
    placed = _placed(bonds, first)
    held = Held(static, flag(piece.tag, "self_collide", False))
    links = {name: _link(name, bonds, placed, held) for name in bonds.links}
    joints = [bonds.joint(bond, placed) for bond in bonds.holders.values()]
    bonds.check_mimics(joints, piece.tag, piece.source)
    loose = [root for root in bonds.roots() if root != first]
    if static:
        joints += [_standing(bonds, first, root, placed) for root in loose]
        loose = []
    robots = [_robot(root, bonds, links, joints, placed[root], static) for root in (first, *loose)]
    return [_driven(members[0], robots[0]), *robots[1:]]


def _static(members: list[Member]) -> bool:
    piece = members[0].piece
    plane = next((plane for member in members for plane in _planes(member.piece.tag)), None)
    static = flag(piece.tag, "static", False)
    if plane is not None and not static:
        piece.source.warn(plane, "is no shape of a thing that moves; the model is taken as static")
    return static or plane is not None


def _planes(tag: Tag) -> list[Tag]:
    collisions = [collision for link in tag.all("link") for collision in link.all("collision")]
    return [plane for collision in collisions for plane in collision.below("plane")]


def _placed(bonds: Bonds, first: str) -> dict[str, Frame]:
    """The frame in the world in which each of the robot's links is told."""
    placed = {name: bonds.frames.of(name) for name in bonds.links}
    for name, bond in bonds.holders.items():
        if bond.turns and bond.misses(placed[name]):
            placed[name] = Frame(bond.frame.position, placed[name].rotation)
    return placed | {first: bonds.frames.of(bonds.top)}


def _link(name: str, bonds: Bonds, placed: Mapping[str, Frame], held: Held) -> Link:
    member, tag = bonds.links[name]
    frame = (placed[name].inverse @ bonds.frames.of(name)).pose
    link = read_link(tag, bonds.local(name), frame, held, member.piece.source)
    if name not in bonds.holders or not rolls(bonds.holders[name].tag):
        return link
    # What would roll has to slide: a caster that drags keeps the robot from turning.
    return replace(link, surface=replace(link.surface, mu1=0.0, mu2=0.0))


def _standing(bonds: Bonds, first: str, root: str, placed: Mapping[str, Frame]) -> Joint:
    """What holds a loose link of a static model."""
    ends = bonds.local(first), bonds.local(root)
    pose = (placed[first].inverse @ placed[root]).pose
    return Joint(f"{ends[0]} holds {ends[1]}", "fixed", *ends, pose, (1.0, 0.0, 0.0), Limits())


def _robot(
    root: str, bonds: Bonds, links: Mapping[str, Link], joints: list[Joint], at: Frame, static: bool
) -> RobotModel:
    own = bonds.local(root)
    names = set(descend(own, {joint.name: joint for joint in joints}))
    return RobotModel(
        name=f"{bonds.top}_{own.replace(INSIDE, '_')}",
        root=own,
        links={link.name: link for link in links.values() if link.name in names},
        joints={joint.name: joint for joint in joints if joint.child in names},
        drive=None,
        sensors=tuple(sensor for name in bonds.links if bonds.local(name) in names for sensor in _sensors(bonds, name)),
        static=static or root in bonds.grounded,
        pose=at.pose,
    )


def _sensors(bonds: Bonds, name: str) -> list[Sensor]:
    """Those of a link, and of the joint that holds it."""
    member, link = bonds.links[name]
    tags = link.all("sensor") + (bonds.holders[name].tag.all("sensor") if name in bonds.holders else [])
    return [read_sensor(tag, bonds.local(name), member.piece.source) for tag in tags]


def _driven(top: Member, robot: RobotModel) -> RobotModel:
    """The body with the canonical link, which has the model's name and its plugins."""
    piece = top.piece
    drive = read_plugins(piece.tag, robot.links, robot.joints, robot.root, piece.source)
    return replace(robot, name=top.name, drive=drive)
