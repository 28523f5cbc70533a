"""Mass and inertia: whether they are physically possible, and whether they suit the shape."""

from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from holozen.check.geometry import box_of, extent, fixed_bodies, size_of
from holozen.check.mistake import Edit, Mistake
from holozen.check.rule import rule
from holozen.check.subject import Subject
from holozen.robot.files.elements import Tag, number
from holozen.robot.files.shapes import SHAPES
from holozen.robot.inertia import impossible, of_shapes
from holozen.robot.model import HERE, Link, Moments
from holozen.robot.rigid import FALLS, falls_through
from holozen.robot.rotation import Array
from holozen.suggest import listed

FACTOR = 10.0  # between the given inertia and that of the solid shape
MINOR = 0.1  # of the mass of the rigid body; the inertia of a lighter link in it is irrelevant
DENSEST = 25_000.0  # kg/m^3; osmium has 22 600
STEEL = 8_000.0  # kg/m^3
LIGHT = 2.0  # kg; lighter parts are often drawn smaller than they are

COMPUTE = "compute it from the shape"

WORDS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


class Given(Struct, frozen=True):
    """The values of an <inertial>: kg and kg m^2, None if not a number."""

    tag: Tag
    mass_tag: Tag | None
    mass: float | None
    inertia_tag: Tag | None
    inertia: Moments | None


def read_inertial(link: Tag) -> Given | None:
    """The <inertial> of a link's element."""
    tag = link.first("inertial")
    if tag is None:
        return None
    mass, inertia = tag.first("mass"), tag.first("inertia")
    value = (
        number((mass.text if mass.sdf else mass.attributes.get("value", "")).strip())
        if mass
        else None
    )
    return Given(tag, mass, value, inertia, _tensor(inertia) if inertia else None)


def _inertials(subject: Subject) -> Iterator[tuple[str, Given]]:
    """The name of each link with an <inertial>, and that."""
    return ((name, given) for name, tag in subject.links.items() if (given := read_inertial(tag)))


@rule("no-inertia", "error", "a body without mass", "Gazebo drops it, or it cannot move")
def _no_inertia(subject: Subject) -> Iterator[Mistake]:
    """A body is a link with all links fixed to it, above or below: Gazebo adds up their masses."""
    if subject.model is None or subject.model.static or subject.sdf:
        return  # SDF: a link without <inertial> has 1 kg
    weighed = {name for name, tag in subject.links.items() if tag.first("inertial")}
    if not weighed:
        yield Mistake(
            subject.root,
            "no link has an <inertial>",
            "give each link that is a real part mass and inertia",
        )
        return
    for group in fixed_bodies(subject.model):
        if group == ["world"]:
            continue
        lead = subject.links[group[0]]
        solid = [
            name for name in group if subject.model.links[name].collisions and name not in weighed
        ]
        # A link with mass and no shape of its own stands for the whole body, above it too.
        has_own = any(not subject.model.links[name].collisions for name in weighed & set(group))
        carrying = [] if has_own else [name for name in solid if _carries(name, subject)]
        if not weighed & set(group) and (len(fixed_bodies(subject.model)) > 1 or solid):
            fixed = f", and none of {len(group) - 1} fixed to it has one" if len(group) > 1 else ""
            yield Mistake(
                lead, f"link {group[0]!r} has no <inertial>{fixed}", "add mass and inertia"
            )
        elif carrying:
            tag = subject.links[carrying[0]]
            yield Mistake(
                tag,
                f"link {carrying[0]!r} has a collision and moving parts but no <inertial>",
                "add one",
            )


@rule("mass", "error", "a negative or missing mass", "it is physically impossible")
def _bad_mass(subject: Subject) -> Iterator[Mistake]:
    for name, given in _inertials(subject):
        if given.mass_tag is None and subject.sdf:
            continue
        if given.mass_tag is None:
            yield Mistake(
                given.tag,
                f"the <inertial> of link {name!r} has no <mass>",
                'add <mass value="..."/>, in kg',
            )
        elif given.mass is None and not subject.sdf and "value" not in given.mass_tag.attributes:
            continue  # misspelt, or reported by the loader
        elif given.mass is None:
            yield Mistake(
                given.mass_tag, f"the mass of link {name!r} is not a number", "write one, in kg"
            )
        elif given.mass < 0:
            yield Mistake(
                given.mass_tag,
                f"link {name!r} has a mass of {given.mass:g} kg",
                "give it its mass in kg",
            )


@rule(
    "massless",
    "warning",
    "a mass or an inertia of zero",
    "without mass Gazebo drops the link, without inertia it spins",
)
def _no_mass(subject: Subject) -> Iterator[Mistake]:
    for name, given in _inertials(subject):
        if given.mass == 0 and given.mass_tag:
            fix = "give it its mass in kg, or remove the <inertial> if it is only a frame"
            yield Mistake(given.mass_tag, f"link {name!r} has a mass of 0 kg", fix)
        elif given.mass and given.inertia and not any(given.inertia):
            problem = (
                f"the inertia of link {name!r} is zero, with a mass of {given.mass:g} kg: "
                "Gazebo keeps it, and it spins"
            )
            yield Mistake(given.inertia_tag, problem, COMPUTE, _computed(name, given, subject))


@rule("heavy", "warning", "a mass impossible for its size", "motors and contacts fail")
def _absurd_mass(subject: Subject) -> Iterator[Mistake]:
    """Links denser than any metal, and robots denser than steel."""
    total, dense = 0.0, False
    for name, given in _inertials(subject):
        mass = given.mass or 0.0
        total += max(mass, 0.0)
        box = box_of([shape for shape in subject.placed if shape.link == name])
        if box and mass > LIGHT and _volume(size_of(box)) * DENSEST < mass:
            problem = (
                f"link {name!r} has {mass:g} kg in {dimensions(size_of(box))}, denser than "
                "any metal"
            )
            yield Mistake(given.mass_tag, problem, "write kilograms, and sizes in metres")
            dense = True
    box = box_of(subject.placed)
    if not dense and box and total > 100 and _volume(size_of(box)) * STEEL < total:
        problem = (
            f"the robot has {total:g} kg in {dimensions(size_of(box))}, denser than a block "
            "of steel"
        )
        yield Mistake(subject.root, problem, "write kilograms, and sizes in metres")


@rule("inertia", "error", "a physically impossible inertia", "the robot shakes or flies off")
def _impossible_inertia(subject: Subject) -> Iterator[Mistake]:
    """Missing, not positive definite, or with one moment above the sum of the other two."""
    for name, given in _inertials(subject):
        if given.mass == 0 or (given.inertia_tag is None and (subject.sdf or not given.mass)):
            continue
        if given.inertia_tag is None:
            problem = f"link {name!r} has a mass and no <inertia>"
            yield Mistake(given.tag, problem, "add one", _computed(name, given, subject))
        elif (
            not subject.sdf
            and any(given.inertia or ())
            and (lost := _missing_moments(given.inertia_tag))
        ):
            problem = (
                f"the inertia of link {name!r} has no {' and no '.join(lost)}; omitted values are 0"
            )
            yield Mistake(given.inertia_tag, problem, COMPUTE, _computed(name, given, subject))
        elif given.inertia and any(given.inertia) and (problem := impossible(given.inertia)):
            problem = f"the inertia of link {name!r} {problem}"
            yield Mistake(given.inertia_tag, problem, COMPUTE, _computed(name, given, subject))


@rule(
    "inertia-part",
    "warning",
    "an inertia without its six values",
    "ROS and Gazebo do not load the robot",
)
def _incomplete_inertia(subject: Subject) -> Iterator[Mistake]:
    """Here omitted products are 0. Omitted moments, and misspelt attributes, are the mistakes of
    other rules.
    """
    for name, given in _inertials(subject) if not subject.sdf else ():
        tag = given.inertia_tag
        if tag is None or _missing_moments(tag) or not set(tag.attributes) <= set(WORDS):
            continue
        if lost := [word for word in WORDS if tag.given(word) is None]:
            zeros = [f'{word}="0"' for word in lost]
            problem = f"the inertia of link {name!r} has no {' and no '.join(lost)}"
            yield Mistake(tag, problem, f"write {' '.join(zeros)}")


@rule(
    "inertia-size",
    "warning",
    "an inertia 10 times larger or smaller than the shape's",
    "it turns too hard or too easily",
)
def _unlike_shape(subject: Subject) -> Iterator[Mistake]:
    """Compares with a solid body of the link's shape and mass."""
    if subject.model is None:
        return
    for group in fixed_bodies(subject.model):
        weight = sum(
            inertial.mass for name in group if (inertial := subject.model.links[name].inertial)
        )
        for name in group:
            given, link = read_inertial(subject.links[name]), subject.model.links[name]
            if given is None or not given.inertia or not given.mass or given.mass < MINOR * weight:
                continue
            solid = solid_moment(link, given.mass)
            largest = max(given.inertia[0], given.inertia[3], given.inertia[5])
            if (
                solid
                and not impossible(given.inertia)
                and not solid / FACTOR <= largest <= solid * FACTOR
            ):
                problem = f"link {name!r} has moments of inertia up to {largest:.3g} kg m^2"
                shape = f"; a solid body of its shape and {given.mass:g} kg has {solid:.3g}"
                yield Mistake(
                    given.inertia_tag, problem + shape, "compute it from the shape and the mass"
                )


@rule("floating", "warning", "a body without gravity", "nothing keeps it on the ground")
def _floating(subject: Subject) -> Iterator[Mistake]:
    """Gravity is off for more than half of the mass of a body."""
    if subject.model is None or subject.model.static:
        return
    for group in fixed_bodies(subject.model):
        masses = {
            name: inertial.mass
            for name in group
            if (inertial := subject.model.links[name].inertial)
        }
        light = [name for name in masses if not subject.model.links[name].gravity]
        if light and sum(masses[name] for name in light) > sum(masses.values()) / 2:
            whole = (
                "it" if group == light[:1] else f"what is fixed together with it ({listed(group)})"
            )
            problem = f"gravity is off for link {light[0]!r}, so {whole} floats"
            yield Mistake(
                _gravity(light[0], subject),
                problem,
                "remove that setting unless it is meant to float",
            )


@rule("no-collision", "warning", "a robot without a collision shape", "nothing carries it")
def _bodiless(subject: Subject) -> Iterator[Mistake]:
    if subject.model is not None and falls_through(subject.model):
        yield Mistake(subject.root, f"{subject.root} {FALLS}", "give a link a <collision>")


def _gravity(link: str, subject: Subject) -> Tag:
    """The element that switches gravity off for a link."""
    owners = [
        gazebo
        for gazebo in subject.root.all("gazebo")
        if gazebo.attributes.get("reference", "").strip() == link
    ]
    settings = [tag for owner in (*owners, subject.links[link]) for tag in owner.children]
    return next((tag for tag in settings if "gravity" in tag.name.lower()), subject.links[link])


def solid_moment(link: Link, mass: float) -> float:
    """The largest moment of inertia in kg m^2, about its centre, of the link's solid shape; 0 if it
    has none.

    The shape is the collision shape, else the visual one; of several, the one with nearly all of
    their volume, if any.
    """
    shapes = link.collisions or link.visuals
    boxes = [box for shape in shapes if shape.kind in SHAPES and (box := extent(shape))]
    if not shapes or len(boxes) < len(shapes):
        return 0.0
    volumes = [_volume(size_of(box)) for box in boxes]
    largest = max(volumes)
    shape = replace(shapes[volumes.index(largest)], pose=HERE)
    per_mass = of_shapes(replace(link, collisions=(shape,)))
    return mass * max(per_mass) if per_mass and sum(volumes) < 1.25 * largest else 0.0


def dimensions(size: Array) -> str:
    """A size (3,) in metres as text, such as 0.4 x 0.2 x 0.1 m."""
    return " x ".join(f"{value:.3g}" for value in size) + " m"


def _computed(name: str, given: Given, subject: Subject) -> Edit | None:
    """The edit that gives a link the <inertia> of its solid collision shapes; None if its inertial
    frame is rotated, or it has no such shape, or a mesh is missing.
    """
    link = subject.model.links.get(name) if subject.model and not subject.sdf else None
    origin = given.tag.first("origin")
    turned = bool(origin and any(number(word) for word in origin.attributes.get("rpy", "").split()))
    per_mass = of_shapes(link) if link and not turned and not subject.guessed else None
    if per_mass is None or not given.mass:
        return None
    moments = " ".join(
        f'{word}="{value * given.mass:.4g}"' for word, value in zip(WORDS, per_mass, strict=True)
    )
    return Edit("inertia", "<inertia>" if given.inertia_tag else "", f"<inertia {moments}/>", name)


def _missing_moments(inertia: Tag) -> list[str]:
    return [word for word in WORDS if word[1] == word[2] and inertia.given(word) is None]


def _tensor(tag: Tag) -> Moments | None:
    """The tensor of an <inertia>; None if a value is not a number. Omitted values are 0, in SDF 1
    on the diagonal.
    """
    texts = [tag.given(word) or ("1" if tag.sdf and word[1] == word[2] else "0") for word in WORDS]
    values = [value for text in texts if (value := number(text)) is not None]
    if len(values) < len(WORDS):
        return None
    xx, xy, xz, yy, yz, zz = values
    return xx, xy, xz, yy, yz, zz


def _carries(name: str, subject: Subject) -> bool:
    return any(
        joint.parent == name and joint.kind != "fixed" for joint in subject.loaded.joints.values()
    )


def _volume(size: Array) -> float:
    return float(size.prod())
