"""SDF models -> robots and other bodies: named frames, the joint graph, and one robot per tree of
joints.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from msgspec import Struct
from msgspec.structs import replace

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import LARGEST, MAX_WARNINGS, Source, Tag, read_xml
from holozen.robot.files.gazebo_plugins import read_forces, read_plugins, warn_unseen
from holozen.robot.files.sdf import (
    AS_FIXED,
    GEARBOX,
    Includes,
    ModelFlags,
    Piece,
    axis_of,
    check_known,
    flag,
    has_spring,
    kind_of,
    read_joint,
    read_link,
    read_pose,
    rolls,
    version_of,
)
from holozen.robot.files.sensors import sdf_sensors, warn_unsimulated
from holozen.robot.files.urdf import check_mimics
from holozen.robot.model import MAX_PARTS, Joint, Limits, Link, Pose, RobotModel, Vector, descend
from holozen.robot.rigid import Frame
from holozen.robot.rotation import triple
from holozen.suggest import cut, listed

# Named frames. A full name starts at the outermost model: `table::drawer::knob`. The empty name is
# the world.


WORLD = ""
INSIDE = "::"


class _Node(Struct, frozen=True):
    """A frame as written: `pose` relative to the frame called `within` in `scope`."""

    tag: Tag
    scope: str
    within: str
    pose: Pose
    attached: str  # the name, in `scope`, of what it is attached to; empty for a link and a model
    is_link: bool


def whole(scope: str, name: str) -> str:
    """The full name of `name` in `scope`."""
    if name in ("__model__", ""):
        return scope
    return f"{scope}{INSIDE}{name}" if scope else name


class Frames:
    """Frames by full name. They are added in any order, and looked up once all of them are
    known.
    """

    def __init__(self) -> None:
        self._nodes: dict[str, _Node] = {}
        self._found = {WORLD: Frame.of(Pose())}
        self._roots: dict[str, str] = {}  # model -> its canonical link, by its local name

    def add_model(self, tag: Tag, scope: str, name: str, canonical: str) -> None:
        """Add a model, with the local name of its canonical link, empty if it has none. Raises
        RobotError, as do the methods below, for an invalid pose and for a duplicate name.
        """
        self._add(whole(scope, name), tag, scope)
        self._roots[whole(scope, name)] = canonical

    def add_link(self, tag: Tag, scope: str) -> None:
        """Add a link; its pose is relative to the model unless it says otherwise."""
        self._add(whole(scope, tag.word("name")), tag, scope, is_link=True)

    def add_frames(self, tag: Tag, scope: str) -> None:
        """Add the `<frame>` elements of a model or a world; each is attached to the model unless it
        says otherwise.
        """
        for frame in tag.all("frame"):
            attached = frame.attributes.get("attached_to", "").strip()
            self._add(
                whole(scope, frame.word("name")), frame, scope, attached, attached or "__model__"
            )

    def add_joint(self, tag: Tag, scope: str, child: str) -> str:
        """Add a joint's own frame, relative to its child unless it says otherwise; returns its full
        name.
        """
        name = whole(scope, tag.word("name"))
        taken = self._nodes.get(name)
        if taken and taken.is_link:  # SDF 1.6 and older let a joint and a link share a name
            name = f"{name} "
        self._add(name, tag, scope, child, child)
        return name

    def of(self, name: str) -> Frame:
        """The frame with a full name, in the outermost one. Raises RobotError for circular
        references.
        """
        chain: dict[str, None] = {}
        while name not in self._found:
            if name in chain:
                circle = [*chain][[*chain].index(name) :]
                raise self._nodes[name].tag.wrong(
                    f"has a circular pose reference: {listed(circle)}"
                )
            chain[name] = None
            node = self._nodes[name]
            name = self._known(node.tag, node.scope, node.within)
        frame = self._found[name]
        for inner in reversed(chain):
            frame = self._found[inner] = frame @ Frame.of(self._nodes[inner].pose)
        return frame

    def resolve(self, tag: Tag, scope: str, name: str) -> Frame:
        """The frame called `name` in `scope`, in the outermost one. Raises RobotError if there is
        none.
        """
        return self.of(self._known(tag, scope, name))

    def link(self, tag: Tag, scope: str, name: str) -> str:
        """The full name of the link that `name` in `scope` is attached to; WORLD for the world
        itself.

        Raises RobotError for an unknown name, a circular reference, and a model without a link.
        """
        if name == "world":
            return WORLD
        seen: set[str] = set()
        found = self._known(tag, scope, name)
        while not (node := self._nodes.get(found)) or not node.is_link:
            if found in seen:
                raise tag.wrong(f"names {cut(name)}, which is attached to itself in a loop")
            seen.add(found)
            found = self._next(tag, found, node)
        return found

    def _next(self, tag: Tag, name: str, node: _Node | None) -> str:
        """The full name of the frame or link that the frame `name`, which is not a link, is
        attached to.
        """
        if node is not None and node.attached:
            return self._known(node.tag, node.scope, node.attached)
        if not self._roots.get(name):
            raise tag.wrong(f"names {cut(name.rpartition(INSIDE)[2])}, which has no link")
        return self._known(tag, name, self._roots[name])

    def _known(self, tag: Tag, scope: str, name: str) -> str:
        """The full name of `name` in `scope`. Raises RobotError if there is no such frame."""
        found = WORLD if name in ("world", "__root__") and not scope else whole(scope, name)
        if found and found not in self._nodes:
            start = f"{scope}{INSIDE}" if scope else ""
            inside = [key[len(start) :].strip() for key in self._nodes if key.startswith(start)]
            raise tag.wrong(f"names the unknown frame {cut(name)}; frames: {listed(inside)}")
        return found

    def _add(
        self,
        name: str,
        tag: Tag,
        scope: str,
        within: str = "",
        attached: str = "",
        is_link: bool = False,
    ) -> None:
        at = read_pose(tag)
        if name in self._nodes:
            place = self._nodes[name].tag.place
            raise tag.wrong(f"has a duplicate name (first at {place}); give each a unique name")
        self._nodes[name] = _Node(tag, scope, at.within or within, at.pose, attached, is_link)


# A model and the models nested in it.


class Member(Struct, frozen=True):
    """A model, possibly nested in another one, by its full name; `joints` are its joint elements,
    each with the full name of its frame.
    """

    name: str
    piece: Piece
    joints: tuple[tuple[Tag, str], ...]


def register(piece: Piece, scope: str, frames: Frames, includes: Includes) -> list[Member]:
    """A model and those nested in it, the outer one first; their frames are added to `frames`.
    Raises RobotError.
    """
    tag = piece.tag
    check_known(tag, piece.source, includes.warned)
    name = _name(piece)
    nested = list(includes.within(piece))
    names = [link.word("name") for link in tag.all("link")] + [
        inner.tag.word("name") for inner in nested
    ]
    canonical = tag.attributes.get("canonical_link", "").strip() or next(iter(names), "")
    frames.add_model(tag, scope, name, canonical)
    inside = whole(scope, name)
    for link in tag.all("link"):
        frames.add_link(link, inside)
    members = [member for inner in nested for member in register(inner, inside, frames, includes)]
    frames.add_frames(tag, inside)
    joints = (
        (joint, frames.add_joint(joint, inside, joint_end(joint, "child")))
        for joint in tag.all("joint")
    )
    return [Member(inside, piece, tuple(joints)), *members]


def joint_end(tag: Tag, end: str) -> str:
    """The name in the `<parent>` or `<child>` (`end`) of a joint. Raises RobotError."""
    name = tag.given(end)
    if not name:
        raise tag.wrong(f"has no <{end}>; write the name of a link there")
    return name


def _name(piece: Piece) -> str:
    tag = piece.tag
    name = tag.word("name")
    if INSIDE in name:
        raise tag.wrong(f"has {INSIDE!r} in its name, which is reserved for nested names")
    if tag.first("placement_frame") or tag.attributes.get("placement_frame"):
        piece.source.warn(tag, "has an unknown placement_frame; its own frame is used")
    return name


# The joint graph.


OFF_AXIS = 1e-9  # m


class JointEdge(Struct, frozen=True):
    """A joint element between two links, by full names; `name` is its local name in the model.

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
        """Whether it is a rotary joint."""
        return kind_of(self.tag) in ("revolute", "continuous")

    def misses(self, frame: Frame) -> bool:
        """Whether the axis misses the origin of `frame`."""
        x, y, z = (there - here for there, here in zip(self.frame.xyz, frame.xyz, strict=True))
        a, b, c = self.axis
        cross = (y * c - z * b, z * a - x * c, x * b - y * a)
        return max(map(abs, cross)) > OFF_AXIS


class JointGraph(Struct):
    """The links of a model and its nested models, the parent joint of each, and the links that a
    joint attaches to the world (`grounded`); all by full name. `top` is the model's.
    """

    top: str
    frames: Frames
    links: dict[str, tuple[Member, Tag]] = {}
    parents: dict[str, JointEdge] = {}
    grounded: set[str] = set()

    @classmethod
    def of(cls, members: list[Member], frames: Frames) -> "JointGraph":
        """The graph of a model and its nested models. Raises RobotError unless its joints form
        trees.
        """
        graph = cls(members[0].name, frames)
        for member in members:
            for tag in member.piece.tag.all("link"):
                graph.links[whole(member.name, tag.word("name"))] = member, tag
        graph._check_size(members)
        for member in members:
            for tag, frame in member.joints:
                graph._add_edge(member, tag, frame)
        graph._check_circles(members[0].piece.tag)
        return graph

    def local(self, name: str) -> str:
        """The local name of a link or a joint in the model."""
        return name.removeprefix(f"{self.top}{INSIDE}")

    def root_above(self, link: str) -> str:
        """The root of the tree that contains `link`."""
        while link in self.parents:
            link = self.parents[link].parent
        return link

    def roots(self) -> list[str]:
        """The links without a parent joint, in file order."""
        return [name for name in self.links if name not in self.parents]

    def joint(self, edge: JointEdge, placed: Mapping[str, Frame]) -> Joint:
        """The robot's joint, for links whose frames in the world are `placed`. Raises
        RobotError.
        """
        ends = self.local(edge.parent), self.local(edge.child)
        joint = read_joint(
            edge.tag, edge.name, ends, (placed[edge.parent], placed[edge.child]), edge.axis
        )
        if joint.mimic is None:
            return joint
        scope = edge.name.removesuffix(edge.tag.word("name"))
        return replace(joint, mimic=replace(joint.mimic, joint=scope + joint.mimic.joint))

    def check_mimics(self, joints: list[Joint], tag: Tag, source: Source) -> None:
        """Raise RobotError for a joint that mimics a missing joint, or itself."""
        named = [
            replace(edge.tag, attributes={"name": edge.name}) for edge in self.parents.values()
        ]
        check_mimics(replace(tag, children=named), {joint.name: joint for joint in joints}, source)

    def _check_size(self, members: list[Member]) -> None:
        links, joints = len(self.links), sum(len(member.joints) for member in members)
        if max(links, joints) > MAX_PARTS:
            problem = (
                f"has {links} links and {joints} joints; a model has at most {MAX_PARTS} of each"
            )
            raise members[0].piece.tag.wrong(problem)

    def _add_edge(self, member: Member, tag: Tag, frame: str) -> None:
        """Add a joint element to the graph."""
        source, kind = member.piece.source, kind_of(tag)
        if kind == GEARBOX:
            source.warn(tag, "is a gearbox, which is not simulated, and is left out")
            return
        if (written := tag.word("type").strip()) in AS_FIXED:
            slides = (
                f", and its link {cut(joint_end(tag, 'child'))} slides without friction"
                if rolls(tag)
                else ""
            )
            source.warn(
                tag,
                f"is of the type {written}, which is not simulated; it is treated as fixed{slides}",
            )
        if kind != "fixed" and has_spring(tag):
            source.warn(tag, "has a spring, which is not simulated")
        parent, child = (
            self.frames.link(tag, member.name, joint_end(tag, end)) for end in ("parent", "child")
        )
        self._check_ends(tag, parent, child)
        if parent != WORLD:
            self.parents[child] = self._edge(member, tag, frame, (parent, child))
            return
        if kind != "fixed":
            source.warn(
                tag,
                f"is a {kind} joint to the world, which is not simulated; what is attached to it "
                "is static",
            )
        self.grounded.add(child)

    def _edge(self, member: Member, tag: Tag, frame: str, ends: tuple[str, str]) -> JointEdge:
        direction, within = axis_of(tag, member.piece.version)
        own = self.frames.of(frame)
        seen_in = self.frames.resolve(tag, member.name, within) if within else own
        name = self.local(whole(member.name, tag.word("name")))
        return JointEdge(tag, name, *ends, own, triple(seen_in.rotation @ direction))

    def _check_ends(self, tag: Tag, parent: str, child: str) -> None:
        for name in (parent, child):
            if name not in self.links and (name != WORLD or name == child):
                raise tag.wrong(
                    f"connects {cut(self.local(name) or 'the world')}, which is not a link of "
                    "this model"
                )
        if parent == child:
            raise tag.wrong(f"connects the link {cut(self.local(child))} to itself")
        if child in self.parents or child in self.grounded:
            other = repr(self.parents[child].name) if child in self.parents else "to the world"
            problem = (
                f"has the child link {cut(self.local(child))}, which is already the child "
                f"of the joint {other}"
            )
            raise tag.wrong(f"{problem}; remove one, or swap the parent and the child of one")

    def _check_circles(self, tag: Tag) -> None:
        roots = self.roots()
        reached = {*roots, *(edge.child for root in roots for edge in descend(root, self.parents))}
        lost = [self.local(name) for name in self.links if name not in reached]
        if lost:
            raise tag.wrong(
                f"has joints that form a loop through the links {listed(lost)}; remove one joint"
            )


# One robot per tree of joints.


def build(members: list[Member], frames: Frames) -> list[RobotModel]:
    """The robots of a model: the one with its canonical link, then one for each other tree of
    links; a static model is always one.

    The root link of the first robot has the model's own frame, which is its `pose`. A link whose
    frame is off its joint's axis gets a frame on the axis. Raises RobotError.
    """
    piece = members[0].piece
    graph = JointGraph.of(members, frames)
    if not graph.links:
        piece.source.warn(piece.tag, "has no <link> and is left out")
        return []
    static = _static(members)
    first = graph.root_above(frames.link(piece.tag, WORLD, graph.top))
    placed = _placed(graph, first)
    for name, (_, tag) in graph.links.items():
        if not static and max(map(abs, frames.of(name).xyz)) > LARGEST:
            raise (tag.first("pose") or tag).wrong(
                f"puts it beyond {LARGEST:g} m, where only a static model may be"
            )
    flags = ModelFlags(static, flag(piece.tag, "self_collide", False))
    links = {name: _link(name, graph, placed, flags) for name in graph.links}
    joints = [graph.joint(edge, placed) for edge in graph.parents.values()]
    graph.check_mimics(joints, piece.tag, piece.source)
    loose = [root for root in graph.roots() if root != first]
    if static:
        joints += [_fixing(graph, first, root, placed) for root in loose]
        loose = []
    for member in members:
        for joint in member.piece.tag.all("joint"):
            for sensor in joint.all("sensor"):
                warn_unsimulated(sensor, member.piece.source)
    robots = [_robot(root, graph, links, joints, placed[root], static) for root in (first, *loose)]
    return [
        _sensing(robot, graph, placed, members[0].piece)
        for robot in (_driven(members[0], robots[0]), *robots[1:])
    ]


def _sensing(
    robot: RobotModel, graph: JointGraph, placed: Mapping[str, Frame], piece: Piece
) -> RobotModel:
    """The robot, with the sensors of its links added."""
    owners = (
        (
            graph.local(name),
            (placed[name].inverse @ graph.frames.of(name)).pose,
            tag,
            member.piece.source,
        )
        for name, (member, tag) in graph.links.items()
        if graph.local(name) in robot.links and tag.first("sensor")
    )
    sensors = tuple(sdf_sensors(owners, robot.links))
    warn_unseen(piece.tag, robot.drive, sensors, piece.source)
    return replace(robot, sensors=sensors)


def _static(members: list[Member]) -> bool:
    piece = members[0].piece
    plane = next((plane for member in members for plane in _planes(member.piece.tag)), None)
    static = flag(piece.tag, "static", False)
    if plane is not None and not static:
        piece.source.warn(plane, "is not a shape of a moving body; the model is treated as static")
    return static or plane is not None


def _planes(tag: Tag) -> list[Tag]:
    collisions = [collision for link in tag.all("link") for collision in link.all("collision")]
    return [plane for collision in collisions for plane in collision.below("plane")]


def _placed(graph: JointGraph, first: str) -> dict[str, Frame]:
    """Link -> the frame in the world in which it is expressed."""
    placed = {name: graph.frames.of(name) for name in graph.links}
    for name, edge in graph.parents.items():
        if edge.turns and edge.misses(placed[name]):
            placed[name] = Frame(edge.frame.position, placed[name].rotation)
    return placed | {first: graph.frames.of(graph.top)}


def _link(name: str, graph: JointGraph, placed: Mapping[str, Frame], flags: ModelFlags) -> Link:
    member, tag = graph.links[name]
    frame = (placed[name].inverse @ graph.frames.of(name)).pose
    link = read_link(tag, graph.local(name), frame, flags, member.piece.source)
    if name not in graph.parents or not rolls(graph.parents[name].tag):
        return link
    # A caster that should roll slides instead: one that drags keeps the robot from turning.
    return replace(link, surface=replace(link.surface, mu1=0.0, mu2=0.0))


def _fixing(graph: JointGraph, first: str, root: str, placed: Mapping[str, Frame]) -> Joint:
    """The joint that fixes a loose link of a static model to the first one."""
    ends = graph.local(first), graph.local(root)
    pose = (placed[first].inverse @ placed[root]).pose
    return Joint(f"{ends[0]} holds {ends[1]}", "fixed", *ends, pose, (1.0, 0.0, 0.0), Limits())


def _robot(
    root: str,
    graph: JointGraph,
    links: Mapping[str, Link],
    joints: list[Joint],
    at: Frame,
    static: bool,
) -> RobotModel:
    own = graph.local(root)
    names = {own, *(joint.child for joint in descend(own, {joint.name: joint for joint in joints}))}
    return RobotModel(
        name=f"{graph.top}_{own.replace(INSIDE, '_')}",
        root=own,
        links={link.name: link for link in links.values() if link.name in names},
        joints={joint.name: joint for joint in joints if joint.child in names},
        drive=None,
        static=static or root in graph.grounded,
        pose=at.pose,
    )


def _driven(top: Member, robot: RobotModel) -> RobotModel:
    """The robot with the canonical link, which has the model's name, drive and forces."""
    piece = top.piece
    drive = read_plugins(piece.tag, robot.links, robot.joints, robot.root, piece.source)
    drive, forces = read_forces(piece.tag, robot.links, robot.root, drive, piece.source)
    return replace(robot, name=top.name, drive=drive, forces=forces)


def parse_sdf(root: Tag, source: Source) -> RobotModel:
    """The only robot in an `<sdf>`. Raises RobotError, also for a world, for several models, and
    for parts that no joint connects to the robot.
    """
    models = read_models(root, source)
    if len(models) > 1:
        names = listed([model.name for model in models])
        raise root.wrong(
            f"holds {len(models)} bodies that no joint connects ({names}); a robot has to be one "
            "body"
        )
    return models[0]


def read_models(root: Tag | str, source: Source) -> list[RobotModel]:
    """The bodies in the `<sdf>` of an object or a robot, each with its `pose`; at least one.

    A model whose links are not all connected by joints becomes several bodies, which move freely;
    the one with the canonical link comes first and has the model's name. Raises RobotError.
    """
    if isinstance(root, str):
        root = read_xml(root, str(source.origin))
    if root.name != "sdf":
        raise root.wrong("is not an <sdf>; an SDF file starts with <sdf version=...>")
    if root.first("world"):
        raise root.wrong(
            "contains a <world>, not a robot or an object; pass it to the simulator as --world"
        )
    models = list(models_in(Piece(root, source, version_of(root)), Frames(), Includes()))
    if not models:
        raise root.wrong("has no <model> with a <link>")
    return [replace(models[0], warnings=tuple(source.warnings)), *models[1:]]


def models_in(outer: Piece, frames: Frames, includes: Includes) -> Iterator[RobotModel]:
    """The bodies directly inside an `<sdf>`, in file order. Raises RobotError."""
    families = [register(piece, WORLD, frames, includes) for piece in includes.within(outer)]
    names = set[str]()
    for family in families:
        yield from _unique(family, frames, names)


def models_of_world(outer: Piece, frames: Frames, includes: Includes) -> Iterator[RobotModel]:
    """The bodies of a `<world>`, in file order. A model that is wrong is left out, with a
    warning.
    """
    families, names = list[list[Member]](), set[str]()
    for tag in outer.tag.children:
        with _leaving_out(outer.source):
            if piece := includes.one(outer, tag):
                families.append(register(piece, WORLD, frames, includes))
    for family in families:
        with _leaving_out(outer.source):
            yield from list(_unique(family, frames, names))


@contextmanager
def _leaving_out(source: Source) -> Iterator[None]:
    try:
        yield
    except RobotError as error:
        if len(source.warnings) < MAX_WARNINGS:
            source.warnings.append(f"{error}; this model of the world is left out")


def _unique(family: list[Member], frames: Frames, names: set[str]) -> Iterator[RobotModel]:
    """The bodies of a model, whose names are added to those taken."""
    for model in build(family, frames):
        if model.name in names:
            raise family[0].piece.tag.wrong(
                f"makes a second body called {cut(model.name)}; give each a unique name"
            )
        names.add(model.name)
        yield model
