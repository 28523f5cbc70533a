"""What holds the links of an SDF model together, and which of them stand or move on their own."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from holozen.robot.errors import cut, listed
from holozen.robot.mimics import check_mimics
from holozen.robot.model import MOST_PARTS
from holozen.robot.parts import Joint, Limits, Pose
from holozen.robot.rigid import Frame
from holozen.robot.rotation import triple
from holozen.robot.sdf.frames import INSIDE, WORLD, Frames, whole
from holozen.robot.sdf.joints import AS_FIXED, GEARBOX, axis_of, has_spring, kind_of, read_joint, rolls
from holozen.robot.sdf.members import Member, joint_end
from holozen.robot.source import Source
from holozen.robot.tag import Tag, Vector
from holozen.robot.tree import descend

OFF_AXIS = 1e-9  # m


@dataclass(frozen=True, slots=True)
class Bond:
    """A joint element between two links, by whole names; `name` is the model's own for it.

    `frame` is the joint's, and `axis` a unit vector, both in the world.
    """

    tag: Tag
    name: str
    parent: str
    child: str
    frame: Frame
    axis: Vector

    @property
    def turns(self) -> bool:
        """Whether it is a hinge."""
        return kind_of(self.tag) in ("revolute", "continuous")

    def misses(self, frame: Frame) -> bool:
        """Whether the axis does not go through the origin of `frame`."""
        x, y, z = (there - here for there, here in zip(self.frame.xyz, frame.xyz, strict=True))
        a, b, c = self.axis
        cross = (y * c - z * b, z * a - x * c, x * b - y * a)
        return max(map(abs, cross)) > OFF_AXIS


@dataclass(slots=True)
class Bonds:
    """The links of a model and those inside it, the joint that holds each, and the links that hang on the world."""

    top: str
    frames: Frames
    links: dict[str, tuple[Member, Tag]] = field(default_factory=dict)
    holders: dict[str, Bond] = field(default_factory=dict)
    grounded: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, members: list[Member], frames: Frames) -> "Bonds":
        """The bonds of a model and those inside it. Raises RobotError unless its joints make trees."""
        bonds = cls(members[0].name, frames)
        for member in members:
            for tag in member.piece.tag.all("link"):
                bonds.links[whole(member.name, tag.word("name"))] = member, tag
        bonds._check_size(members)
        for member in members:
            for tag, frame in member.joints:
                bonds._bind(member, tag, frame)
        bonds._check_circles(members[0].piece.tag)
        return bonds

    def local(self, name: str) -> str:
        """What the model itself calls a link or a joint."""
        return name.removeprefix(f"{self.top}{INSIDE}")

    def root_above(self, link: str) -> str:
        """The link that carries `link` and that no joint holds."""
        while link in self.holders:
            link = self.holders[link].parent
        return link

    def roots(self) -> list[str]:
        """The links that no joint holds on another, in the order of the file."""
        return [name for name in self.links if name not in self.holders]

    def joint(self, bond: Bond, placed: Mapping[str, Frame]) -> Joint:
        """The robot's joint, for links whose frames in the world are `placed`. Raises RobotError."""
        ends = self.local(bond.parent), self.local(bond.child)
        joint = read_joint(bond.tag, bond.name, ends, (placed[bond.parent], placed[bond.child]), bond.axis)
        if joint.mimic is None:
            return joint
        scope = bond.name.removesuffix(bond.tag.word("name"))
        return replace(joint, mimic=replace(joint.mimic, joint=scope + joint.mimic.joint))

    def check_mimics(self, joints: list[Joint], tag: Tag, source: Source) -> None:
        """Raises RobotError for a joint that follows one which is not there, or itself."""
        named = [replace(bond.tag, attributes={"name": bond.name}) for bond in self.holders.values()]
        check_mimics(replace(tag, children=named), {joint.name: joint for joint in joints}, source)

    def _check_size(self, members: list[Member]) -> None:
        links, joints = len(self.links), sum(len(member.joints) for member in members)
        if max(links, joints) > MOST_PARTS:
            told = f"has {links} links and {joints} joints; a model has at most {MOST_PARTS} of each"
            raise members[0].piece.tag.wrong(told)

    def _bind(self, member: Member, tag: Tag, frame: str) -> None:
        """Notes what a joint element holds on what."""
        source, kind = member.piece.source, kind_of(tag)
        if kind == GEARBOX:
            source.warn(tag, "is a gearbox, which is not simulated, and is left out")
            return
        if tag.word("type").strip() in AS_FIXED:
            slides = f", and its link {cut(joint_end(tag, 'child'))} slides without friction" if rolls(tag) else ""
            told = f"is of the type {tag.word('type').strip()}, which is not simulated; it is taken as fixed{slides}"
            source.warn(tag, told)
        if kind != "fixed" and has_spring(tag):
            source.warn(tag, "has a spring, which is not simulated")
        parent, child = (self.frames.link(tag, member.name, joint_end(tag, end)) for end in ("parent", "child"))
        self._check_ends(tag, parent, child)
        if parent != WORLD:
            self.holders[child] = self._bond(member, tag, frame, (parent, child))
            return
        if kind != "fixed":
            source.warn(tag, f"is a {kind} joint to the world, which is not simulated; what hangs on it stands still")
        self.grounded.add(child)

    def _bond(self, member: Member, tag: Tag, frame: str, ends: tuple[str, str]) -> Bond:
        direction, within = axis_of(tag, member.piece.version)
        own = self.frames.of(frame)
        seen_in = self.frames.told(tag, member.name, within) if within else own
        name = self.local(whole(member.name, tag.word("name")))
        return Bond(tag, name, *ends, own, triple(seen_in.rotation @ direction))

    def _check_ends(self, tag: Tag, parent: str, child: str) -> None:
        for name in (parent, child):
            if name not in self.links and (name != WORLD or name == child):
                raise tag.wrong(f"holds {cut(self.local(name) or 'the world')}, which is no link of this model")
        if parent == child:
            raise tag.wrong(f"holds the link {cut(self.local(child))} on itself")
        if child in self.holders or child in self.grounded:
            holder = repr(self.holders[child].name) if child in self.holders else "to the world"
            told = f"has the child link {cut(self.local(child))}, which the joint {holder} has already"
            raise tag.wrong(f"{told}; take one away, or swap the parent and the child of one")

    def _check_circles(self, tag: Tag) -> None:
        joints = {
            name: Joint(name, "fixed", bond.parent, bond.child, Pose(), bond.axis, Limits())
            for name, bond in self.holders.items()
        }
        reached = {name for root in self.roots() for name in descend(root, joints)}
        lost = [self.local(name) for name in self.links if name not in reached]
        if lost:
            raise tag.wrong(f"has joints that go in a circle through the links {listed(lost)}; take one joint away")
