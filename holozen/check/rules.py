"""Every rule, in the order in which a file is best mended."""

from collections.abc import Iterator

from holozen.check import (
    driving,
    inertias,
    joints,
    measures,
    mesh_files,
    names,
    overlapping,
    spelling,
    standing,
    wanted,
)
from holozen.check.finding import Mistake, Rule
from holozen.check.loading import said
from holozen.check.subject import Subject


def _errors(subject: Subject) -> Iterator[Mistake]:
    yield from said(subject, "error")


def _warnings(subject: Subject) -> Iterator[Mistake]:
    yield from said(subject, "warning")


def _nothing(_: Subject) -> Iterator[Mistake]:
    return iter(())


FATAL = Rule(
    "file",
    "error",
    "a file that is no robot: broken XML, xacro that cannot be expanded",
    "nothing in it can be used",
    _nothing,
)
LOAD = Rule(
    "load",
    "error",
    "what keeps the file from being loaded, beside the rules below",
    "the robot cannot be spawned",
    _errors,
)
NOTE = Rule(
    "load-note",
    "warning",
    "what is replaced when the file is loaded, beside the rules below",
    "the robot is not the one that is written",
    _warnings,
)

RULES = (
    Rule("tag", "error", "a misspelt element", "it is passed over in silence", spelling.misspelt_tags),
    Rule("attribute", "error", "a misspelt attribute", "it is passed over in silence", spelling.misspelt_attributes),
    Rule("place", "error", "an element where nothing reads it", "it is passed over in silence", spelling.misplaced),
    Rule("ignored", "warning", "an element that URDF does not have", "URDF readers pass over it", spelling.ignored),
    Rule("joint-type", "error", "a joint type that does not exist", "the robot cannot be loaded", spelling.joint_kinds),
    Rule("twice", "error", "two links or two joints with one name", "nobody knows which is meant", names.duplicates),
    Rule("no-link", "error", "a joint that names no link", "it hangs in the air", names.unknown_links),
    Rule(
        "gazebo-link",
        "warning",
        "a gazebo tag that names no link",
        "its settings are lost, as in Gazebo",
        names.unknown_references,
    ),
    Rule("tree", "error", "links that are not one tree", "the robot falls apart", names.unconnected),
    Rule(
        "colour", "warning", "a material without a colour, or with two", "the colour is left to chance", names.colours
    ),
    Rule("unused-colour", "warning", "a material that nothing uses", "a name may be misspelt", names.unused_colours),
    Rule("macro-twice", "warning", "a macro that is defined twice", "the first one is lost", names.macros_twice),
    Rule("unused", "warning", "a property or macro that nothing uses", "a name may be misspelt", names.unused_macros),
    Rule("limit", "error", "a revolute or prismatic joint without limit", "URDF readers refuse it", joints.no_limit),
    Rule("limit-range", "error", "a joint limit that leaves no way", "the joint cannot move", joints.empty_limit),
    Rule("limit-effort", "warning", "a limit without effort or velocity", "motors have no strength", joints.no_effort),
    Rule("mimic", "error", "a joint that mimics nothing", "the joint does not move", joints.mimics),
    Rule("degrees", "warning", "an angle in degrees", "URDF and SDF count in radians", joints.degrees),
    Rule("no-inertia", "error", "a body without mass", "Gazebo drops it, or it cannot move", inertias.no_inertia),
    Rule("mass", "error", "a mass of zero or below", "no body has it", inertias.bad_mass),
    Rule("heavy", "warning", "a mass that its size cannot have", "motors and contacts fail", inertias.absurd_mass),
    Rule(
        "inertia", "error", "an inertia that no body has", "the robot shakes or flies off", inertias.impossible_inertia
    ),
    Rule(
        "inertia-size",
        "warning",
        "an inertia 10 times off from the shape's",
        "it turns too hard or too easily",
        inertias.unlike_shape,
    ),
    Rule(
        "wheel-collision",
        "error",
        "a wheel without collision shape",
        "it sinks into the floor",
        standing.wheel_collisions,
    ),
    Rule(
        "wheel-axis",
        "error",
        "a wheel that turns about another axis than its cylinder's",
        "it tumbles instead of rolling",
        standing.wheel_axes,
    ),
    Rule(
        "wheel-height",
        "warning",
        "a wheel above the ground, or deeper than the others",
        "it does not drive, or the robot leans",
        standing.wheel_heights,
    ),
    Rule(
        "overlap",
        "warning",
        "a wheel inside another, or more than half of it inside the body",
        "no real robot has them so",
        overlapping.overlaps,
    ),
    Rule(
        "wheel-load",
        "warning",
        "a part of the body that is as low as the wheels",
        "it drags over the ground, and the wheels slip",
        standing.dragging,
    ),
    Rule(
        "wheel-side",
        "error",
        "a left wheel on the right side, or the other way round",
        "it turns the wrong way: the plugin's tags say which side is which",
        measures.sides,
    ),
    Rule(
        "wheel-measure",
        "warning",
        "a plugin's wheel separation or diameter, 20 % off from the robot's",
        "it turns or drives at another speed than it is told",
        measures.measures,
    ),
    Rule("plugin-name", "error", "a misspelt plugin", "Gazebo does not find it", driving.misspelt_plugins),
    Rule("plugin", "warning", "an unknown plugin", "it does nothing here", driving.unknown_plugins),
    Rule(
        "plugin-link",
        "warning",
        "a plugin's frame that is no link",
        "odometry and sensors get a frame that is not there",
        driving.plugin_links,
    ),
    Rule(
        "plugin-joint",
        "error",
        "a plugin's joint that is not there",
        "the plugin has nothing to turn",
        driving.plugin_joints,
    ),
    Rule("two-drives", "warning", "two plugins that drive", "they work against each other", driving.two_drives),
    Rule(
        "no-drive",
        "warning",
        "wheels and plugin tags, but nothing that drives",
        "cmd_vel moves nothing",
        driving.no_drive,
    ),
    Rule("mesh", "error", "a mesh that is not found", "the part is invisible or a box", mesh_files.missing),
    Rule(
        "mesh-path", "warning", "a mesh at a path of another machine", "others will not find it", mesh_files.elsewhere
    ),
    Rule("mesh-empty", "error", "a mesh that is empty or broken", "the part has no shape", mesh_files.unreadable),
    Rule("mesh-unit", "warning", "a mesh in the wrong unit", "it is far too large or too small", mesh_files.units),
    Rule("fits", "error", "a robot larger than --fits", "the task sets its size", wanted.too_large),
    Rule(
        "require-file",
        "error",
        "a line of --require that says nothing",
        "nothing is compared with it",
        wanted.bad_needs,
    ),
    Rule(
        "require",
        "error",
        "a link or joint of --require that is not there",
        "the task sets its names",
        wanted.missing_names,
    ),
)


def table() -> str:
    """The rules as a table in Markdown."""
    rows = [f"| `{rule.name}` | {rule.severity} | {rule.finds} | {rule.why} |" for rule in (FATAL, LOAD, NOTE, *RULES)]
    return "\n".join(["| rule | severity | finds | since |", "|---|---|---|---|", *rows]) + "\n"
