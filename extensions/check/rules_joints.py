"""Joint limits, mimics, and angles in degrees."""

import math
from collections.abc import Iterator

from holozen.check.mistake import Mistake
from holozen.check.rule import rule
from holozen.check.subject import Subject
from holozen.robot.files.elements import Tag, number
from holozen.robot.model import MOVING
from holozen.suggest import suggest

LARGE_ANGLE = 20.0  # rad; more than three turns, and written as a round number of degrees


@rule("limit", "error", "a revolute or prismatic joint without limit", "URDF parsers reject it")
def _no_limit(subject: Subject) -> Iterator[Mistake]:
    """Not in SDF, where a joint without <limit> is unlimited."""
    for tag in subject.root.all("joint") if not subject.sdf else ():
        if _is_bounded(tag) and tag.first("limit") is None:
            kind = tag.attributes["type"]
            free = ', or make it type="continuous"' if kind == "revolute" else ""
            fix = f'add <limit lower="-1" upper="1" effort="5" velocity="5"/>{free}'
            yield Mistake(tag, f"{tag} is {kind} and has no <limit>", fix)


@rule("limit-range", "error", "a joint limit without range", "the joint cannot move")
def _empty_limit(subject: Subject) -> Iterator[Mistake]:
    for tag in subject.root.all("joint"):
        limit = _limit(tag, subject.sdf)
        if limit is None or not _is_bounded(tag):
            continue
        lower, upper = (
            _value(limit, word, None if subject.sdf else 0.0) for word in ("lower", "upper")
        )
        if lower is not None and upper is not None and lower > upper:
            yield Mistake(limit, f"{tag} has lower={lower:g} above upper={upper:g}", "swap them")
        elif lower is not None and lower == upper:
            fix = 'set lower and upper, in rad or m, or make it type="fixed"'
            yield Mistake(limit, f"{tag} cannot move: lower and upper are both {lower:g}", fix)


@rule("limit-effort", "warning", "a limit without effort or velocity", "motors have no strength")
def _no_effort(subject: Subject) -> Iterator[Mistake]:
    for tag in subject.root.all("joint"):
        limit = _limit(tag, subject.sdf)
        if limit is None or tag.attributes.get("type") not in MOVING or tag.first("mimic"):
            continue
        for word, unit in (("effort", "N m (or N)"), ("velocity", "rad/s (or m/s)")):
            value = _value(limit, word, math.inf if subject.sdf or not _is_bounded(tag) else None)
            if value is None and not limit.given(word):
                yield Mistake(
                    limit, f"the limit of {tag} has no {word}", f'add {word}="...", in {unit}'
                )
            elif value == 0:
                yield Mistake(
                    limit,
                    f"the limit of {tag} has {word} 0",
                    f"give it a {word} above 0, in {unit}",
                )


@rule("mimic", "error", "a joint that mimics a missing joint, or itself", "the joint does not move")
def _mimics(subject: Subject) -> Iterator[Mistake]:
    """A leader is missing, or is the joint itself, directly or through others."""
    leaders = {name: tag.first("mimic") for name, tag in subject.joints.items()}
    for name, mimic in leaders.items():
        leader = mimic.attributes.get("joint", "").strip() if mimic else ""
        if mimic and leader and leader not in subject.joints:
            problem = (
                f"joint {name!r} mimics {leader!r}, which does not "
                f"exist{suggest(leader, subject.joints)}"
            )
            yield Mistake(mimic, problem, "name a joint of this robot")
        elif mimic and _comes_back(name, leaders):
            yield Mistake(
                mimic,
                f"joint {name!r} mimics itself through {leader!r}",
                "remove the <mimic> of one of them",
            )


@rule("degrees", "warning", "an angle in degrees", "URDF and SDF use radians")
def _degrees(subject: Subject) -> Iterator[Mistake]:
    for tag in subject.root.walk():
        words = [tag.attributes.get("rpy", "")] if tag.name == "origin" else []
        if tag.name == "limit" and tag.parent and tag.parent.attributes.get("type") == "revolute":
            words = [tag.attributes.get(name, "") for name in ("lower", "upper")]
        angles = [
            value for text in words for word in text.split() if (value := number(word)) is not None
        ]
        if large := [
            angle for angle in angles if LARGE_ANGLE < abs(angle) <= 720 and angle % 5 == 0
        ]:
            fix = f"write {math.radians(large[0]):.4g}, or ${{radians({large[0]:g})}} in xacro"
            yield Mistake(tag, f"{tag} has the angle {large[0]:g}, which looks like degrees", fix)


def _is_bounded(tag: Tag) -> bool:
    return tag.attributes.get("type") in ("revolute", "prismatic")


def _limit(tag: Tag, sdf: bool) -> Tag | None:
    axis = tag.first("axis") if sdf else tag
    return axis.first("limit") if axis else None


def _value(limit: Tag, word: str, default: float | None) -> float | None:
    """A number of a <limit>; None if it is left out without a default, or is not a number."""
    text = limit.given(word)
    return default if text is None else number(text)


def _comes_back(name: str, leaders: dict[str, Tag | None]) -> bool:
    here, seen = name, set[str]()
    while here not in seen:
        seen.add(here)
        mimic = leaders.get(here)
        here = mimic.attributes.get("joint", "").strip() if mimic else ""
    return here == name
