"""What `<gazebo>` elements say of a robot and its links."""

from collections.abc import Mapping
from dataclasses import replace

from holozen.robot.errors import cut, listed
from holozen.robot.materials import gazebo_color
from holozen.robot.parts import Joint, Link, Surface
from holozen.robot.plugins.settings import Settings
from holozen.robot.source import Source
from holozen.robot.tag import Tag

CONTACT = ("mu", "mu1", "mu2", "kp", "kd")
STIFFEST = 1e18  # N/m; Gazebo's own default is 1e12


def read_gazebo(
    robot: Tag, links: Mapping[str, Link], joints: Mapping[str, Joint], source: Source
) -> tuple[dict[str, Link], bool]:
    """The links with what `<gazebo reference="...">` adds to them, and whether the robot is static.

    A later element wins over an earlier one, a material here over one of URDF: sdformat's parser_urdf.cc
    does the same. Raises RobotError.
    """
    dressed, static = dict(links), False
    for tag in robot.all("gazebo"):
        name = tag.attributes.get("reference", "").strip()
        if not name:
            static = Settings(tag).flag("static", default=static)
        elif name in dressed:
            dressed[name] = _dressed(dressed[name], tag, source)
        elif name not in joints:
            near = source.nearest(name, (*links, *joints))
            told = f"reference={cut(name)} names no link and no joint{near}; it is left out"
            source.warn(tag, f"{told}; the links there are: {listed(list(links))}")
    return dressed, static


def _dressed(link: Link, tag: Tag, source: Source) -> Link:
    settings = Settings(_with_contact(tag))
    color = gazebo_color(tag, source)
    # The two ways to say it: <gravity>0</gravity> of SDF, and the older <turnGravityOff>.
    light = settings.flag("turn_gravity_off", default=not link.gravity)
    return replace(
        link,
        surface=_surface(link.surface, settings),
        gravity=settings.flag("gravity", default=not light),
        visuals=tuple(replace(shape, color=color) for shape in link.visuals) if color else link.visuals,
    )


def _surface(before: Surface, settings: Settings) -> Surface:
    told = {
        "mu1": settings.maybe("mu1", "mu"),
        "mu2": settings.maybe("mu2", "mu"),
        "kp": settings.maybe("kp", most=STIFFEST),
        "kd": settings.maybe("kd", most=STIFFEST),
    }
    given = {name: value for name, value in told.items() if value is not None}
    self_collide = settings.flag("self_collide", default=before.self_collide)
    return replace(before, self_collide=self_collide, **given)


def _with_contact(tag: Tag) -> Tag:
    """The element with SDF's `<collision><surface>...<mu>` and so on as if they stood directly in it."""
    inside = [deep for collision in tag.all("collision") for name in CONTACT for deep in collision.below(name)]
    return replace(tag, children=[*tag.children, *inside]) if inside else tag
