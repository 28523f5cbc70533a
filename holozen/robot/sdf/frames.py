"""The named frames of an SDF file, each told in another one.

A name is whole, from the outside inwards: `table::drawer::knob`. The empty name is the frame that everything stands in.
"""

from dataclasses import dataclass

from holozen.robot.errors import RobotError, cut, listed
from holozen.robot.parts import Pose
from holozen.robot.rigid import Frame
from holozen.robot.tag import Tag

WORLD = ""
INSIDE = "::"


@dataclass(frozen=True, slots=True)
class _Node:
    """A frame as it is written: `pose` in the frame that `scope` knows as `within`."""

    tag: Tag
    scope: str
    within: str
    pose: Pose
    attached: str  # the name, in `scope`, of what it moves with; empty for a link and a model
    is_link: bool


def whole(scope: str, name: str) -> str:
    """The whole name of what `scope` calls `name`."""
    if name in ("__model__", ""):
        return scope
    return f"{scope}{INSIDE}{name}" if scope else name


class Frames:
    """Frames by whole name. They may be added in any order, and are looked up when all of them are there."""

    def __init__(self) -> None:
        self._nodes: dict[str, _Node] = {}
        self._found = {WORLD: Frame.of(Pose())}
        self._roots: dict[str, str] = {}  # model -> its canonical link, as the model calls it

    def add_model(self, tag: Tag, scope: str, name: str, within: str, pose: Pose, canonical: str) -> None:
        """A model, whose `canonical` link is empty if it has none. Raises RobotError for a name that is taken."""
        self._add(whole(scope, name), _Node(tag, scope, within, pose, "", False))
        self._roots[whole(scope, name)] = canonical

    def add_link(self, tag: Tag, scope: str, within: str, pose: Pose) -> None:
        """A link; `pose` in the frame `within`, or else the model's. Raises RobotError for a name that is taken."""
        self._add(whole(scope, tag.word("name")), _Node(tag, scope, within, pose, "", True))

    def add_frame(self, tag: Tag, scope: str, within: str, pose: Pose, attached: str) -> None:
        """A frame that moves with `attached`, or else the model. Raises RobotError for a name that is taken."""
        node = _Node(tag, scope, within or attached, pose, attached or "__model__", False)
        self._add(whole(scope, tag.word("name")), node)

    def add_joint(self, tag: Tag, scope: str, within: str, pose: Pose, child: str) -> str:
        """A joint's own frame, in that of its child unless `within` says another; returns its whole name."""
        name = whole(scope, tag.word("name"))
        taken = self._nodes.get(name)
        if taken and taken.is_link:  # SDF 1.6 and older let a joint and a link share a name
            name = f"{name} "
        self._add(name, _Node(tag, scope, within or child, pose, child, False))
        return name

    def of(self, name: str) -> Frame:
        """The frame with a whole name, in the outermost one. Raises RobotError for frames that go in a circle."""
        chain: dict[str, None] = {}
        while name not in self._found:
            if name in chain:
                circle = [*chain][[*chain].index(name) :]
                raise self._nodes[name].tag.wrong(f"has a pose that goes in a circle: {listed(circle)}")
            chain[name] = None
            name = self._base(self._nodes[name])
        frame = self._found[name]
        for inner in reversed(chain):
            frame = self._found[inner] = frame @ Frame.of(self._nodes[inner].pose)
        return frame

    def told(self, tag: Tag, scope: str, name: str) -> Frame:
        """The frame that `scope` calls `name`, in the outermost one. Raises RobotError if there is none."""
        return self.of(self._known(tag, scope, name))

    def link(self, tag: Tag, scope: str, name: str) -> str:
        """The whole name of the link that what `scope` calls `name` moves with; WORLD for the world itself.

        Raises RobotError for an unknown name, a circle, and a model without a link.
        """
        if name == "world":
            return WORLD
        seen: set[str] = set()
        found = self._known(tag, scope, name)
        while not (node := self._nodes.get(found)) or not node.is_link:
            if found in seen:
                raise tag.wrong(f"names {cut(name)}, which is attached in a circle")
            seen.add(found)
            found = self._next(tag, found, node)
        return found

    def _next(self, tag: Tag, name: str, node: _Node | None) -> str:
        if node is not None and node.attached:
            return self._known(node.tag, node.scope, node.attached)
        if not self._roots.get(name):
            raise tag.wrong(f"names {cut(name.rpartition(INSIDE)[2])}, which has no link")
        return self._known(tag, name, self._roots[name])

    def _base(self, node: _Node) -> str:
        return self._known(node.tag, node.scope, node.within)

    def _known(self, tag: Tag, scope: str, name: str) -> str:
        found = WORLD if name in ("world", "__root__") and not scope else whole(scope, name)
        if found and found not in self._nodes:
            raise self._unknown(tag, scope, name)
        return found

    def _unknown(self, tag: Tag, scope: str, name: str) -> RobotError:
        start = f"{scope}{INSIDE}" if scope else ""
        inside = [key[len(start) :].strip() for key in self._nodes if key.startswith(start)]
        return tag.wrong(f"names the frame {cut(name)}; the frames there are: {listed(inside)}")

    def _add(self, name: str, node: _Node) -> None:
        if name in self._nodes:
            place = self._nodes[name].tag.place
            raise node.tag.wrong(f"has a name that is taken ({place}); give each its own")
        self._nodes[name] = node
