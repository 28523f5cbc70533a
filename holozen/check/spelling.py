"""Misspelt and misplaced elements and attributes: readers pass over both in silence."""

from collections.abc import Iterator

from holozen.check.finding import Mistake
from holozen.check.subject import Subject
from holozen.check.vocabulary import GAZEBO, IGNORED, MISPLACED, PLUGIN, SDF, URDF
from holozen.check.words import nearest
from holozen.robot.parts import JOINT_KINDS
from holozen.robot.tag import Tag

MOST_GUESSES = 500  # of different words
FREE = ("gazebo", "transmission")  # hold what URDF does not know
SDF_JOINT_KINDS = (*JOINT_KINDS, "revolute2", "universal", "ball", "screw", "gearbox")


def misspelt_tags(subject: Subject) -> Iterator[Mistake]:
    """Elements that are not known, and near one that may stand there."""
    guessed: dict[tuple[str, frozenset[str]], str | None] = {}
    for tag, known, shortest in _read_elements(subject):
        if tag.name in known or ":" in tag.name or len(guessed) > MOST_GUESSES:
            continue
        if (tag.name, known) not in guessed:
            guessed[tag.name, known] = nearest(tag.name, known, shortest)
        meant = guessed[tag.name, known]
        if shortest >= 4 and meant and tag.name.startswith(meant):
            continue  # another word that only begins so, as some plugin may have
        if meant and meant.lower() != tag.name.replace("_", "").lower():
            yield Mistake(tag, f"there is no element <{tag.name}>", f"write <{meant}>")
        elif meant and shortest < 4:
            yield Mistake(tag, f"<{tag.name}> is not <{meant}>: capitals and underscores count", f"write <{meant}>")


def misspelt_attributes(subject: Subject) -> Iterator[Mistake]:
    """Attributes of URDF elements that are not known, and near one that is."""
    for tag in _urdf_elements(subject):
        given = set(tag.attributes)
        known = URDF[tag.name].attributes
        for word in sorted(given - known):
            # Of words that are equally near, the one that is missing was meant.
            meant = None if ":" in word else nearest(word, sorted(known - given)) or nearest(word, sorted(known))
            if meant:
                yield Mistake(tag, f"{tag} has no attribute {word!r}", f"write {meant}=")


def misplaced(subject: Subject) -> Iterator[Mistake]:
    """Elements of URDF in an element where nothing reads them."""
    for parent in _urdf_elements(subject):
        for tag in parent.children if parent.name not in FREE else ():
            if tag.name in MISPLACED and tag.name not in URDF[parent.name].children:
                owners = " or ".join(f"<{name}>" for name in MISPLACED[tag.name])
                yield Mistake(tag, f"<{tag.name}> stands in {parent}, which has none", f"move it into {owners}")


def ignored(subject: Subject) -> Iterator[Mistake]:
    """Elements of SDF, or of older URDF, in a URDF."""
    for parent in _urdf_elements(subject):
        for tag in parent.children if parent.name not in FREE else ():
            if tag.name in IGNORED:
                yield Mistake(tag, f"<{tag.name}> in {parent} is not read", IGNORED[tag.name])


def joint_kinds(subject: Subject) -> Iterator[Mistake]:
    """Joint types that do not exist."""
    kinds = SDF_JOINT_KINDS if subject.sdf else JOINT_KINDS
    for tag in subject.root.all("joint"):
        kind = tag.attributes.get("type")
        if kind is not None and kind not in kinds:
            meant = nearest(kind, kinds)
            mend = f'write type="{meant}"' if meant else f"write one of {', '.join(kinds)}"
            yield Mistake(tag, f"{tag} has the type {kind!r}, which does not exist", mend)


def _read_elements(subject: Subject) -> Iterator[tuple[Tag, frozenset[str], int]]:
    """Each element with the words that may stand in its place, and the length from which a word is guessed at."""
    if subject.sdf:
        yield from ((tag, SDF, 4) for tag in _outside_plugins(subject.root) if tag.name not in MISPLACED)
        yield from ((tag, PLUGIN, 6) for plugin in subject.plugins for tag in plugin.children)
        return
    for parent in _urdf_elements(subject):
        if parent.name not in FREE:
            yield from ((tag, URDF[parent.name].children, 3) for tag in parent.children if tag.name not in URDF)
    for gazebo in subject.root.all("gazebo"):
        yield from ((tag, GAZEBO, 4) for tag in gazebo.children)
        for plugin in gazebo.below("plugin"):
            yield from ((tag, PLUGIN, 6) for tag in plugin.children)


def _urdf_elements(subject: Subject) -> Iterator[Tag]:
    """The elements of URDF in their place; what stands inside <gazebo> and <transmission> is not looked at."""
    waiting = [] if subject.sdf else [subject.root]
    while waiting:
        tag = waiting.pop()
        yield tag
        known = URDF[tag.name].children  # none for those two
        waiting += [child for child in reversed(tag.children) if child.name in known and child.name in URDF]


def _outside_plugins(root: Tag) -> Iterator[Tag]:
    waiting = [root]
    while waiting:
        tag = waiting.pop()
        yield tag
        if tag.name != "plugin":
            waiting += tag.children[::-1]
