"""Plugins: whether they exist, whether the links and joints that they name exist, and whether one
drives the robot.
"""

import re
from collections.abc import Iterator

from holozen.check.mistake import Mistake
from holozen.check.rule import rule
from holozen.check.spelling import nearest
from holozen.check.subject import Subject
from holozen.robot.files.elements import Tag
from holozen.robot.files.gazebo_plugins import (
    DRIVES,
    KNOWN,
    MOVING_ELSEWHERE,
    OMNI,
    file_name,
    file_of,
    kind_of,
)
from holozen.robot.rigid import advised_drive
from holozen.suggest import listed, suggest

SUGGESTED = ("gazebo_ros_planar_move", "gazebo_ros_diff_drive", "gazebo_ros_skid_steer_drive")
FAMILIES = re.compile(
    r"gazebo_|gz|ign|hector_|roboticsgroup_|velodyne|ros_control|realsense|.*Plugin$|mimic|joint_state",
    re.IGNORECASE,
)
"""The names of plugins that exist, though holozen does not support all of them."""

LINK_TAGS = ("robotbaseframe", "robotbaselink", "bodyname")
FRAME_TAGS = ("framename", "frameid", "childframeid")


@rule("plugin-name", "error", "a misspelt plugin", "Gazebo does not find it")
def _misspelt_plugins(subject: Subject) -> Iterator[Mistake]:
    """Also one without `lib` or `.so`: Gazebo classic opens the file under that very name; gz-sim
    completes names.
    """
    for plugin in subject.plugins:
        kind, file = kind_of(plugin), file_of(plugin)
        meant = _meant(kind) or kind
        classic = kind in KNOWN and not kind.startswith(("gz", "ign")) and kind != OMNI
        if meant != kind or (classic and file.rpartition("/")[2] != file_name(kind)):
            yield Mistake(plugin, f"there is no plugin {file!r}", f"write {file_name(meant)}")


@rule("plugin", "warning", "an unknown plugin", "it is ignored")
def _unknown_plugins(subject: Subject) -> Iterator[Mistake]:
    """Neither supported nor of a known family."""
    for plugin in subject.plugins:
        kind = kind_of(plugin)
        if not file_of(plugin):
            yield Mistake(
                plugin, f"{plugin} has no filename", f"write one, such as {file_name(SUGGESTED[0])}"
            )
        elif kind not in KNOWN and not FAMILIES.match(kind) and not _meant(kind):
            names = ", ".join(map(file_name, SUGGESTED))
            fix = (
                "remove it, or correct its name"
                if _is_driven(subject)
                else f"to drive use one of {names}"
            )
            yield Mistake(plugin, f"plugin {plugin.attributes['filename']!r} is unknown", fix)


@rule(
    "plugin-link",
    "warning",
    "a plugin's frame that is not a link",
    "odometry and sensors refer to a missing frame",
)
def _plugin_links(subject: Subject) -> Iterator[Mistake]:
    for tag in subject.settings:
        name = tag.text.strip().rpartition("/")[2]
        plain = tag.name.lower().replace("_", "")
        if not name or name in subject.links or "::" in name or not subject.links:
            continue
        if plain in LINK_TAGS:
            problem = f"<{tag.name}> is {name!r}, which names no link{suggest(name, subject.links)}"
            yield Mistake(tag, problem, f"links: {listed(subject.links)}")
        elif plain in FRAME_TAGS and (suggestion := nearest(name, subject.links)):
            own = _link_of(tag) if plain != "childframeid" else ""
            fix = (
                f"write {own}, which has the sensor; links: {listed(subject.links)}"
                if own
                else f"write {suggestion}"
            )
            yield Mistake(tag, f"<{tag.name}> is {name!r}, which names no link", fix)


def _link_of(tag: Tag) -> str:
    """The link of the `<sensor>` that contains an element; empty without one."""
    sensor = tag
    while sensor.name != "sensor":
        if sensor.parent is None:
            return ""
        sensor = sensor.parent
    owner = sensor.parent
    return (owner.attributes.get("reference") or owner.attributes.get("name", "")) if owner else ""


@rule(
    "plugin-joint",
    "error",
    "a plugin's joint that does not exist",
    "the plugin has nothing to turn",
)
def _plugin_joints(subject: Subject) -> Iterator[Mistake]:
    """Also the joints of <ros2_control>."""
    controls = [tag for control in subject.root.all("ros2_control") for tag in control.all("joint")]
    named = [(tag, tag.attributes.get("name", "").strip()) for tag in controls]
    for tag, name in [*subject.plugin_joints, *named]:
        if name and name not in subject.joints and "::" not in name and subject.joints:
            owner = "a joint of <ros2_control>" if (tag, name) in named else f"<{tag.name}>"
            problem = f"{owner} is {name!r}, which names no joint{suggest(name, subject.joints)}"
            yield Mistake(tag, problem, f"joints: {listed(subject.joints)}")


@rule("two-drives", "warning", "two drive plugins", "they work against each other")
def _two_drives(subject: Subject) -> Iterator[Mistake]:
    for plugin in subject.drives[1:]:
        yield Mistake(
            plugin,
            f"{plugin} drives the robot, and so does {subject.drives[0]}",
            "keep one of them",
        )


@rule("no-drive", "warning", "wheels and plugin tags, but no drive plugin", "cmd_vel moves nothing")
def _no_drive(subject: Subject) -> Iterator[Mistake]:
    """A file without plugins and <gazebo> elements is a plain description, not meant to drive."""
    controls = [
        tag for tag in subject.plugins if kind_of(tag) in MOVING_ELSEWHERE
    ] + subject.root.all("ros2_control")
    wheels = [wheel for wheel in subject.wheels if wheel.sure]
    simulated = controls or subject.plugins or subject.root.all("gazebo")
    if not simulated or len(wheels) < 2 or _is_driven(subject):
        return
    problem = f"the robot has {len(wheels)} wheels but no drive plugin"
    if controls:
        problem += f"; not supported: {kind_of(controls[0]) or controls[0].name}"
    plugin = file_name(SUGGESTED[len(wheels) % 2 == 0])  # an odd number of wheels are omni wheels
    fix = f"add <gazebo><plugin> with filename={plugin!r}, or spawn it with --drive planar_move"
    if subject.model and advised_drive(subject.model) == "omni":
        fix = f"spawn it with --drive omni, which drives its omni or mecanum wheels; or {fix}"
    elif any("mecanum" in name.lower() for name in (*subject.joints, *subject.links)):
        fix = (
            "add <gazebo><plugin> with filename='gz-sim-mecanum-drive-system'; or "
            f"{fix.removeprefix('add ')}"
        )
    yield Mistake(controls[0] if controls else subject.root, problem, fix)


@rule(
    "static",
    "warning",
    "a robot on wheels, or with a drive, that is fixed to the world",
    "cmd_vel moves nothing",
)
def _fixed_to_world(subject: Subject) -> Iterator[Mistake]:
    model = subject.model
    if (
        model is None
        or not model.static
        or not (model.drive or any(wheel.sure for wheel in subject.wheels))
    ):
        return
    settings = [subject.root, *subject.root.all("gazebo")]
    tag = next(
        (found for owner in settings for found in owner.children if found.name == "static"), None
    )
    if tag:
        yield Mistake(tag, f"{subject.root} is static", "remove <static>")
    else:
        fix = "give it another name, such as base_footprint"
        yield Mistake(
            subject.links[model.root],
            f"the root link is {model.root!r}, which Gazebo fixes in place",
            fix,
        )


def _is_driven(subject: Subject) -> bool:
    """Whether the robot has a drive, or a plugin that may be meant as one."""
    if subject.drives or (subject.model is not None and subject.model.drive is not None):
        return True
    misplaced = subject.root.all("plugin")  # in URDF
    kinds = [kind_of(plugin) for plugin in (*subject.plugins, *misplaced)]
    return any(kind in DRIVES or _meant(kind) in DRIVES for kind in kinds)


def _meant(kind: str) -> str | None:
    """The plugin that a kind is a misspelling of: letters differ, its last word, such as `_drive`,
    is missing, or there is one too many, such as `_plugin`.
    """
    if kind in KNOWN or not kind.startswith("gazebo_ros_"):
        return None if kind in KNOWN else nearest(kind, KNOWN, 6)
    alike = [name for name in DRIVES if name.startswith(f"{kind}_") or kind == f"{name}_plugin"]
    return nearest(kind, KNOWN, 6) or min(alike, key=len, default=None)
