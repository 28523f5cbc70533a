"""What a drive's plugin says of its wheels, beside where they are and how large."""

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import fmean

from holozen.check.finding import Mistake
from holozen.check.placed import Placed, dot
from holozen.check.subject import Subject
from holozen.robot.drives import Differential, Mecanum
from holozen.robot.plugins import DRIVES
from holozen.robot.plugins.names import kind_of
from holozen.robot.rigid import joint_axes, link_frames
from holozen.robot.tag import Tag

OFF = 0.2  # of the robot's own measure
SKID = 2.5  # times its own: what slips sideways as it turns is told a wider base on purpose
ACROSS = 0.01  # m; by which a wheel has to be on the wrong side


@dataclass(frozen=True, slots=True)
class Told:
    """What a drive says: joints of both sides, and metres, 0 where it says nothing."""

    left: tuple[str, ...]
    right: tuple[str, ...]
    separation: float
    radius: float


def sides(subject: Subject) -> Iterator[Mistake]:
    """Wheels that a plugin names as left and that are on the right, or the other way round."""
    told = _told(subject)
    if told is None or not _level(told, subject):
        return
    places = {name: _across(name, subject)[0] for name in (*told.left, *told.right)}
    middle = fmean(places.values())
    wrong = [name for name in told.left if places[name] < middle - ACROSS]
    wrong += [name for name in told.right if places[name] > middle + ACROSS]
    if wrong:
        names = ", ".join(f"{name!r} (a {_side(name, told)} joint, at y={places[name]:.3g} m)" for name in wrong)
        at = next((tag for tag, name in subject.plugin_joints if name == wrong[0]), subject.joints[wrong[0]])
        yield Mistake(at, f"on the other side than its tag says: {names}; left is where y is larger", "exchange them")


def measures(subject: Subject) -> Iterator[Mistake]:
    """A wheel separation or diameter that is not the robot's."""
    told = _told(subject)
    if told is None:
        return
    tag = _tag(subject, "wheelseparation")
    if told.separation and tag and _level(told, subject):
        found = _separations(told, subject)
        most = SKID if len(told.left) > 1 else 1 + OFF
        if not any(1 - OFF <= told.separation / one <= most for one in found if one > 0):
            problem = f"<{tag.name}> is {told.separation:.3g} m, and the wheels are {found[0]:.3g} m apart"
            yield Mistake(tag, problem, f"write {found[0]:.3g}")
    tag = _tag(subject, "wheeldiameter", "wheelradius")
    radii = _radii(told.left[0], subject)
    if told.radius and tag and radii and all(abs(told.radius / radius - 1) > OFF for radius in radii):
        twice = 2 if "diameter" in tag.name.lower() else 1
        child = _child(told.left[0], subject)
        problem = f"<{tag.name}> is {told.radius * twice:.3g} m, and that of {child!r} is {radii[0] * twice:.3g} m"
        yield Mistake(tag, problem, f"write {radii[0] * twice:.3g}")


def _told(subject: Subject) -> Told | None:
    mechanism = subject.model.drive.mechanism if subject.model and subject.model.drive else None
    match mechanism:
        case Differential(left, right, separation, radius):
            return Told(left, right, separation, radius)
        case Mecanum(one, other, back, last, separation, _, radius):
            return Told((one, back), (other, last), separation, radius)
    return None


def _level(told: Told, subject: Subject) -> bool:
    """Whether the axles lie along y: what drives along another axis has its sides elsewhere."""
    assert subject.model is not None
    axes = joint_axes(subject.model)
    return all(abs(dot(axes[name].direction, (0.0, 1.0, 0.0))) > 0.9 for name in (*told.left, *told.right))


def _separations(told: Told, subject: Subject) -> list[float]:
    """The distance in metres between the sides' wheels, and between their joints."""
    left, right = ([_across(name, subject) for name in names] for names in (told.left, told.right))
    return [abs(fmean(a) - fmean(b)) for a, b in zip(zip(*left, strict=True), zip(*right, strict=True), strict=True)]


def _across(joint: str, subject: Subject) -> tuple[float, float]:
    """y in metres, in the root frame, of a wheel's shape and of its joint."""
    assert subject.model is not None
    origin = link_frames(subject.model)[_child(joint, subject)].xyz[1]
    shapes = _shapes(joint, subject)
    return (shapes[0].centre[1] if shapes else origin), origin


def _radii(joint: str, subject: Subject) -> list[float]:
    round_shapes = [shape for shape in _shapes(joint, subject) if shape.shape.kind in ("cylinder", "sphere")]
    return [shape.half[0] for shape in round_shapes]


def _shapes(joint: str, subject: Subject) -> list[Placed]:
    """Those of a wheel, collision shapes first."""
    own = [shape for shape in subject.placed if shape.link == _child(joint, subject)]
    return sorted(own, key=lambda shape: shape.use)


def _child(joint: str, subject: Subject) -> str:
    assert subject.model is not None
    return subject.model.joints[joint].child


def _side(joint: str, told: Told) -> str:
    return "left" if joint in told.left else "right"


def _tag(subject: Subject, *names: str) -> Tag | None:
    """The setting of the plugin that drives."""
    driving = [plugin for plugin in subject.plugins if kind_of(plugin) in DRIVES]
    tags = [tag for plugin in driving[:1] for tag in plugin.children]
    return next((tag for tag in tags if tag.name.lower().replace("_", "") in names), None)
