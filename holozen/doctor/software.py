"""Python and the wheels: what is installed, against what our own metadata asks for."""

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib import metadata

from holozen.about import version
from holozen.doctor.finding import ERROR, OK, WARNING, Finding

WANTED = (3, 11)  # the newest for which pybullet has wheels
NOT_FOR_USERS = ("test",)  # extras
_REQUIREMENT = re.compile(r"([\w.-]+)\s*([^;\[]*)(?:;.*extra == ['\"]([\w-]+)['\"])?")


def python(running: tuple[int, ...] = sys.version_info[:3], machine: str = os.uname().machine) -> Finding:
    """Whether this Python and machine can run all of it."""
    words = f"{'.'.join(map(str, running))} on {os.uname().sysname} {machine}"
    if running[:2] != WANTED:
        only = f"{words}; pybullet, which the sim needs, has no wheels for it"
        return Finding("python", WARNING, only, f"use Python {WANTED[0]}.{WANTED[1]} for `holozen sim`")
    if machine != "x86_64":
        only = f"{words}; pybullet, which the sim needs, has wheels for x86_64 only"
        return Finding("python", WARNING, only, "run `holozen sim` on another machine, and connect from here")
    return Finding("python", OK, words)


def wheels() -> list[Finding]:
    """Whether everything is installed that our metadata asks for."""
    try:
        requirements = metadata.requires("holozen") or []
    except metadata.PackageNotFoundError:
        return [Finding("wheels", WARNING, "holozen is not installed, it runs from a bare tree", "run scripts/venv")]
    return judged(requirements, version)


def judged(requirements: Iterable[str], version: Callable[[str], str]) -> list[Finding]:
    """The findings about `requirements`, as wheels write them."""
    there, bad = [f"holozen {version('holozen')}".strip()], []
    for name, needed in _packages(requirements).items():
        have = version(name)
        there += [f"{name} {have}"] if have else []
        bad += list(_faults(name, have, *needed))
    return bad or [Finding("wheels", OK, ", ".join(there))]


def _packages(requirements: Iterable[str]) -> dict[str, tuple[str, list[str]]]:
    """Name -> limits of the version, and the extras that need it (none: everybody does)."""
    found: dict[str, tuple[str, list[str]]] = {}
    for text in requirements:
        if (parts := _REQUIREMENT.match(text)) and parts[3] not in NOT_FOR_USERS:
            needed = found.setdefault(parts[1], (parts[2].strip(), []))
            needed[1].extend([parts[3]] if parts[3] else [])
    return found


def _faults(name: str, have: str, limits: str, extras: list[str]) -> Iterator[Finding]:
    level = WARNING if extras else ERROR
    mend = f"pip install 'holozen[{extras[0]}]'" if extras else "pip install --upgrade holozen"
    if not have:
        verbs = ", ".join(f"`holozen {extra}`" for extra in extras) or "everything"
        yield Finding("wheels", level, f"{name} is not installed; {verbs} needs it", mend)
    elif not fits(have, limits):
        yield Finding("wheels", level, f"{name} is {have}; it has to be {limits}", f"pip install '{name}{limits}'")


def fits(have: str, limits: str) -> bool:
    """Whether a version such as 1.10.2 is within limits such as `>=1.10,<2`."""
    tests = {">=": _number(have).__ge__, "<": _number(have).__lt__}
    parts = re.findall(r"(>=|<)\s*([\d.]+)", limits)
    return all(tests[sign](_number(limit)) for sign, limit in parts)


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])
