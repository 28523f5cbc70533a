"""An SDF model and the models inside it, with all their frames known."""

from dataclasses import dataclass

from holozen.robot.sdf.frames import INSIDE, Frames, whole
from holozen.robot.sdf.include import Includes, Piece
from holozen.robot.sdf.known import check_known
from holozen.robot.sdf.values import read_pose, word
from holozen.robot.tag import Tag


@dataclass(frozen=True, slots=True)
class Member:
    """A model, or one inside it, by whole name; `joints` are its joint elements and the whole names of their frames."""

    name: str
    piece: Piece
    joints: tuple[tuple[Tag, str], ...]


def register(piece: Piece, scope: str, frames: Frames, includes: Includes) -> list[Member]:
    """A model and those inside it, the outer one first; their frames are added to `frames`. Raises RobotError."""
    tag, placed = piece.tag, read_pose(piece.tag)
    check_known(tag, piece.source, includes.told)
    name = _name(piece)
    nested = list(includes.within(piece))
    names = [link.word("name") for link in tag.all("link")] + [inner.tag.word("name") for inner in nested]
    canonical = tag.attributes.get("canonical_link", "").strip() or next(iter(names), "")
    frames.add_model(tag, scope, name, placed.within, placed.pose, canonical)
    inside = whole(scope, name)
    for link in tag.all("link"):
        at = read_pose(link)
        frames.add_link(link, inside, at.within, at.pose)
    members = [member for inner in nested for member in register(inner, inside, frames, includes)]
    add_frames(tag, inside, frames)
    return [Member(inside, piece, tuple(_joints(tag, inside, frames))), *members]


def add_frames(tag: Tag, scope: str, frames: Frames) -> None:
    """Adds the `<frame>` elements of a model or a world. Raises RobotError."""
    for frame in tag.all("frame"):
        at = read_pose(frame)
        frames.add_frame(frame, scope, at.within, at.pose, frame.attributes.get("attached_to", "").strip())


def joint_end(tag: Tag, end: str) -> str:
    """What the `<parent>` or `<child>` of a joint names. Raises RobotError."""
    name = word(tag, end)
    if not name:
        raise tag.wrong(f"has no <{end}>; write the name of a link there")
    return name


def _name(piece: Piece) -> str:
    tag = piece.tag
    name = tag.word("name")
    if INSIDE in name:
        raise tag.wrong(f"has {INSIDE!r} in its name, which stands between a model and what is inside it")
    if tag.first("placement_frame") or tag.attributes.get("placement_frame"):
        piece.source.warn(tag, "has a placement_frame, which is not known here; its own frame is placed")
    return name


def _joints(tag: Tag, scope: str, frames: Frames) -> list[tuple[Tag, str]]:
    joints = []
    for joint in tag.all("joint"):
        at = read_pose(joint)
        joints.append((joint, frames.add_joint(joint, scope, at.within, at.pose, joint_end(joint, "child"))))
    return joints
