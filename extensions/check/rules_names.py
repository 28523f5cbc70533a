"""Duplicate, unknown and unused names."""

import re
from collections import Counter
from collections.abc import Collection, Iterator

from holozen.check.mistake import Mistake
from holozen.check.rule import rule
from holozen.check.subject import Subject
from holozen.robot.files.elements import Tag
from holozen.suggest import listed, suggest

PALETTE = 2  # this many unused colours are a palette shared by several robots


@rule("twice", "error", "two links or two joints with one name", "references to it are ambiguous")
def _duplicates(subject: Subject) -> Iterator[Mistake]:
    for kind in ("link", "joint"):
        seen: dict[str, Tag] = {}
        for tag in subject.root.all(kind):
            name = tag.attributes.get("name", "")
            first = seen.setdefault(name, tag)
            if name and first is not tag:
                problem = f"{tag} is defined twice, first at {subject.place(first)}"
                if first in subject.calls and tag in subject.calls:
                    (macro, before), (_, again) = subject.calls[first], subject.calls[tag]
                    problem = (
                        f"{tag} is defined twice, in macro {macro!r} called at {before} and "
                        f"at {again}"
                    )
                yield Mistake(tag, problem, "give each a unique name")


@rule("no-link", "error", "a joint that names a missing link", "the joint connects nothing")
def _unknown_links(subject: Subject) -> Iterator[Mistake]:
    for joint in subject.root.all("joint"):
        for end in ("parent", "child"):
            tag = joint.first(end)
            name = _end(tag) if tag else ""
            if tag and name and not _is_link(name, subject):
                yield _unknown(
                    tag,
                    f"{joint} names the {end} link {name!r}, which does not exist",
                    name,
                    subject.links,
                )


@rule(
    "gazebo-link",
    "warning",
    "a gazebo tag that names a missing link",
    "its settings are lost, as in Gazebo",
)
def _unknown_references(subject: Subject) -> Iterator[Mistake]:
    """A file without links is one for others to include."""
    for gazebo in subject.root.all("gazebo") if subject.links else ():
        name = gazebo.attributes.get("reference", "").strip()
        if name and name not in subject.links and name not in subject.joints:
            known = [*subject.links, *subject.joints]
            yield _unknown(gazebo, f"reference={name!r} is neither a link nor a joint", name, known)


@rule("tree", "error", "links that do not form one tree", "the robot falls apart")
def _unconnected(subject: Subject) -> Iterator[Mistake]:
    """Links without a parent joint other than the root, links with two parents, and loops."""
    children = Counter[str]()
    for joint in subject.root.all("joint"):
        tag = joint.first("child")
        child = _end(tag) if tag else ""
        children[child] += 1
        if tag and children[child] == 2 and child in subject.links:
            yield Mistake(tag, f"link {child!r} is the child of two joints", "remove one of them")
    roots = [name for name in subject.links if name not in children]
    if not subject.sdf:
        yield from _circles(subject, roots)
    if len(roots) > 1 and not subject.sdf:
        family = Counter(
            _end(tag) for joint in subject.root.all("joint") if (tag := joint.first("parent"))
        )
        root = max(roots, key=lambda name: family[name])
        for name in roots:
            if name != root:
                fix = "add a joint with it as <child>, or remove the link"
                yield Mistake(
                    subject.links[name],
                    f"link {name!r} has no parent joint; the root is {root!r}",
                    fix,
                )


def _circles(subject: Subject, roots: list[str]) -> Iterator[Mistake]:
    children: dict[str, list[str]] = {}
    for joint in subject.root.all("joint"):
        parent, child = (joint.first(end) for end in ("parent", "child"))
        if child:
            children.setdefault(_end(parent) if parent else "", []).append(_end(child))
    waiting = [*roots, *(name for name in children if name not in subject.links)]
    reached = set(waiting)
    while waiting:
        fresh = set(children.get(waiting.pop(), ())) - reached
        reached |= fresh
        waiting += fresh
    lost = [name for name in subject.links if name not in reached]
    if lost:
        problem = f"joints form a loop through {listed(lost)}"
        yield Mistake(subject.links[lost[0]], problem, "remove one of the joints")


@rule(
    "colour",
    "warning",
    "a material without a colour, with two, or without alpha",
    "the colour is undefined",
)
def _colours(subject: Subject) -> Iterator[Mistake]:
    """Only in URDF, and only materials with a name, but for alpha: nothing refers to others."""
    if subject.sdf:
        return
    given: dict[str, Tag] = {}
    for tag in _materials(subject):
        for words in _colour(tag):
            if len(words) == 3:
                rgba = " ".join(words)
                problem = f"the colour {rgba!r} has no alpha, so ROS shows it black"
                yield Mistake(tag.child("color"), problem, f'write rgba="{rgba} 1"')
        name = tag.attributes.get("name", "").strip()
        if not name:
            continue
        first = given.setdefault(name, tag)
        if tag.children and not first.children:
            given[name] = tag
        elif _colour(tag) != _colour(first) and tag.children:
            yield Mistake(
                tag,
                f"{tag} has another colour at {subject.place(first)}",
                "give each colour a unique name",
            )
    known = [name for name, tag in given.items() if tag.children]
    for name, tag in given.items():
        if not tag.children and not name.startswith("Gazebo/"):
            fix = (
                f'write <material name="{name}"> with a <color rgba="..."/> in it, next to the '
                "links"
            )
            yield Mistake(
                tag, f"material {name!r} has no colour anywhere{suggest(name, known)}", fix
            )


@rule("unused-colour", "warning", "a material that nothing uses", "a name may be misspelt")
def _unused_colours(subject: Subject) -> Iterator[Mistake]:
    """Only materials of the file itself; a palette of several is left alone."""
    used = {
        tag.attributes.get("name", "")
        for tag in _materials(subject)
        if tag.parent is not subject.root
    }
    own = [tag for tag in subject.root.all("material") if subject.is_source(tag)]
    unused = [tag for tag in own if tag.attributes.get("name", "") not in used]
    if used and len(unused) < PALETTE and not any(_colours.find(subject)):
        for tag in unused:
            yield Mistake(tag, f"{tag} is used by no visual", "use it or remove it")


@rule("macro-twice", "warning", "a macro that is defined twice", "the first one is lost")
def _macros_twice(subject: Subject) -> Iterator[Mistake]:
    """In one file, and outside conditions."""
    for source in subject.sources:
        seen: dict[str, Tag] = {}
        for tag in source.root.all("xacro:macro"):
            name = tag.attributes.get("name", "")
            first = seen.setdefault(name, tag)
            if first is not tag:
                yield Mistake(
                    tag,
                    f"macro {name!r} is defined twice, first at {subject.place(first)}",
                    "rename one",
                )


@rule("unused", "warning", "a property or macro that nothing uses", "a name may be misspelt")
def _unused_macros(subject: Subject) -> Iterator[Mistake]:
    if (
        not subject.sources
        or not subject.links
        or any(found is None for source in subject.sources for found in source.includes.values())
    ):
        return  # a computed file name may use anything
    texts = (_NO_USE.sub(" ", source.text) for source in subject.sources)
    words = Counter(word for text in texts for word in re.findall(r"[A-Za-z_]\w*", text))
    for kind in ("property", "macro"):
        tags = [tag for source in subject.sources for tag in source.root.below(f"xacro:{kind}")]
        given = Counter(tag.attributes.get("name", "").removeprefix("xacro:") for tag in tags)
        for tag in subject.sources[0].root.below(f"xacro:{kind}"):
            name = tag.attributes.get("name", "").removeprefix("xacro:")
            if name.isidentifier() and words[name] <= given[name]:
                yield Mistake(tag, f"{kind} {name!r} is not used", "use it or remove it")


_NO_USE = re.compile(
    r"<!--.*?-->|</?[A-Za-z_][\w.-]*(?=[\s/>])|[\w:.-]+\s*=\s*(?=[\"'])", re.DOTALL
)
"""Text that uses no macro or property: comments, names of elements without a prefix, and names of
attributes.
"""


def _end(tag: Tag) -> str:
    return tag.text.strip() if tag.sdf else tag.attributes.get("link", "")


def _is_link(name: str, subject: Subject) -> bool:
    # SDF may name the world, frames, and links of nested models.
    parts = (tag for tag in subject.root.children if tag.name in ("frame", "model", "include"))
    return name in subject.links or (
        subject.sdf and (name == "world" or "::" in name or any(parts))
    )


def _unknown(tag: Tag, problem: str, name: str, known: Collection[str]) -> Mistake:
    return Mistake(tag, problem + suggest(name, known), f"known names: {listed(known)}")


def _materials(subject: Subject) -> Iterator[Tag]:
    yield from subject.root.all("material")
    for link in subject.root.all("link"):
        for visual in link.all("visual"):
            yield from visual.all("material")


def _colour(tag: Tag) -> list[list[str]]:
    colour = tag.first("color")
    return [colour.attributes.get("rgba", "").split()] if colour else []
