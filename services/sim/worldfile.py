"""World files: SDF -> gravity, physics step, real-time factor, ground. What it does not know it names in a warning."""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

STEP = 1 / 240  # s
GRAVITY = (0.0, 0.0, -9.8)  # m/s^2; Gazebo's default
STRONGEST = 100.0  # m/s^2; ten times ours
SHORTEST, LONGEST = 1e-4, 0.02  # s; outside of this the physics engine is hopeless or unstable


class WorldError(ValueError):
    """A world file that cannot be used; the text is one line that says why."""


@dataclass(frozen=True)
class WorldSpec:
    """A world: physics step in s, gravity in m/s^2, real-time factor, whether there is ground, and warnings."""

    name: str = "default"
    step: float = STEP
    gravity: tuple[float, float, float] = GRAVITY
    rtf: float = 1.0
    ground: bool = False
    warnings: tuple[str, ...] = ()


def load(path: Path) -> WorldSpec:
    """The world in an SDF file. Raises WorldError naming the file, and the line of broken XML."""
    try:
        root = ET.fromstring(path.read_bytes())
    except OSError as error:
        raise WorldError(f"world {path}: {error.strerror or error}") from None
    except ET.ParseError as error:
        raise WorldError(f"world {path}: broken XML: {error}") from None
    except (LookupError, ValueError) as error:  # an encoding that Python does not know, or expat does not
        raise WorldError(f"world {path}: {error}; save it as UTF-8") from None
    world = root.find("world")
    if root.tag != "sdf" or world is None:
        raise WorldError(f"world {path}: it holds no <sdf><world>, its root is <{root.tag}>")
    return _world(world, path)


def _world(world: ET.Element, path: Path) -> WorldSpec:
    step = _number(world, "physics/max_step_size", STEP, path)
    if not SHORTEST <= step <= LONGEST:
        raise WorldError(f"world {path}: max_step_size {step:g} s; use {SHORTEST} to {LONGEST}")
    rtf = _number(world, "physics/real_time_factor", 1.0, path)
    if not 0 <= rtf <= 1000:
        raise WorldError(f"world {path}: real_time_factor {rtf:g}; use 0 (as fast as it goes) to 1000")
    parts = [(_part_name(part), part) for part in [*world.iter("include"), *world.findall("model")]]
    unknown = [name for name, part in parts if name != "sun" and not _is_ground(name, part)]
    return WorldSpec(
        name=world.get("name", "default"),
        step=step,
        gravity=_gravity(world, path),
        rtf=rtf,
        ground=any(_is_ground(name, part) for name, part in parts),
        warnings=tuple(
            f"world {path}: model {name!r} is left out; only a ground plane is simulated" for name in unknown
        ),
    )


def _part_name(part: ET.Element) -> str:
    if part.tag == "model":
        return part.get("name", "")
    return (part.findtext("uri") or "").strip().removeprefix("model://")


def _is_ground(name: str, part: ET.Element) -> bool:
    return name.endswith("_plane") or part.find(".//plane") is not None


def _gravity(world: ET.Element, path: Path) -> tuple[float, float, float]:
    text = world.findtext("gravity", world.findtext("physics/gravity"))
    if text is None:
        return GRAVITY
    values = [_finite(part, "gravity", path) for part in text.split()]
    if len(values) != 3:
        raise WorldError(f"world {path}: gravity {text!r}; write three numbers, such as '0 0 -9.8'")
    if max(map(abs, values)) > STRONGEST:
        raise WorldError(f"world {path}: gravity {text!r}; use at most {STRONGEST:g} m/s^2 along each axis")
    return values[0], values[1], values[2]


def _number(world: ET.Element, tag: str, default: float, path: Path) -> float:
    text = world.findtext(tag)
    return default if text is None else _finite(text, tag, path)


def _finite(text: str, what: str, path: Path) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise WorldError(f"world {path}: {what} {text.strip()!r} is not a finite number")
    return value
