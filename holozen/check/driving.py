"""Plugins: that they exist, that what they name exists, and that one of them drives."""

import re
from collections.abc import Iterator

from holozen.check.finding import Mistake
from holozen.check.subject import Subject
from holozen.check.words import closest, nearest
from holozen.robot.errors import listed
from holozen.robot.tag import Tag

DRIVES = (
    "gazebo_ros_planar_move", "gazebo_ros_diff_drive", "gazebo_ros_skid_steer_drive", "gz-sim-velocity-control",
    "gz-sim-diff-drive", "gz-sim-mecanum-drive", "wb_plugin",
)  # fmt: skip
"""Plugins that drive a robot here."""

CONTROLS = (
    "gazebo_ros_control", "gazebo_ros2_control", "gz_ros2_control", "gz_ros2_control-system",
    "gazebo_ros_tricycle_drive", "gazebo_ros_ackermann_drive", "gz-sim-ackermann-steering", "gz-sim-tracked-vehicle",
    "gz-sim-joint-controller", "gz-sim-joint-position-controller", "gazebo_ros_joint_pose_trajectory",
    "gazebo_ros_force",
)  # fmt: skip
"""Plugins that move a robot elsewhere."""

OTHERS = (
    "gazebo_ros_camera", "gazebo_ros_depth_camera", "gazebo_ros_multicamera", "gazebo_ros_triggered_camera",
    "gazebo_ros_openni_kinect", "gazebo_ros_laser", "gazebo_ros_gpu_laser", "gazebo_ros_block_laser",
    "gazebo_ros_ray_sensor", "gazebo_ros_range", "gazebo_ros_imu", "gazebo_ros_imu_sensor", "gazebo_ros_gps_sensor",
    "gazebo_ros_p3d", "gazebo_ros_f3d", "gazebo_ros_ft_sensor", "gazebo_ros_bumper", "gazebo_ros_projector",
    "gazebo_ros_prosilica", "gazebo_ros_video", "gazebo_ros_vacuum_gripper", "gazebo_ros_joint_state_publisher",
    "gazebo_ros_wheel_slip", "gazebo_ros_harness", "gazebo_ros_state", "gazebo_ros_init", "gazebo_ros_factory",
    "gz-sim-odometry-publisher", "gz-sim-joint-state-publisher", "gz-sim-pose-publisher", "gz-sim-imu",
    "gz-sim-sensors", "gz-sim-contact", "gz-sim-wheel-slip",
)  # fmt: skip

FAMILIES = re.compile(
    r"gazebo_|gz|ign|hector_|roboticsgroup_|velodyne|ros_control|realsense|.*Plugin$|mimic|joint_state", re.IGNORECASE
)
"""Names of plugins that are known to exist, though not here."""

LINK_TAGS = ("robotbaseframe", "robotbaselink", "bodyname")
FRAME_TAGS = ("framename", "frameid", "childframeid")


def misspelt_plugins(subject: Subject) -> Iterator[Mistake]:
    """Plugins whose file is near a known one."""
    for plugin in subject.plugins:
        name = plugin_name(plugin)
        known = (*DRIVES, *CONTROLS, *OTHERS)
        meant = None if name in known else nearest(name, known, 6)
        if meant:
            yield Mistake(plugin, f"there is no plugin {plugin.attributes['filename']!r}", f"write {_file(meant)}")


def unknown_plugins(subject: Subject) -> Iterator[Mistake]:
    """Plugins that are neither known nor of a known family."""
    for plugin in subject.plugins:
        name = plugin_name(plugin)
        known = (*DRIVES, *CONTROLS, *OTHERS)
        if not name:
            yield Mistake(plugin, f"{plugin} has no filename", f"write one, such as {_file(DRIVES[0])}")
        elif name not in known and not FAMILIES.match(name) and not nearest(name, known, 6):
            mend = f"to drive use one of {', '.join(map(_file, DRIVES[:3]))}"
            yield Mistake(plugin, f"plugin {plugin.attributes['filename']!r} is not known here, it does nothing", mend)


def plugin_links(subject: Subject) -> Iterator[Mistake]:
    """Frames in plugins that name no link."""
    for tag in _settings(subject):
        name = tag.text.strip().rpartition("/")[2]
        sort = tag.name.lower().replace("_", "")
        if not name or name in subject.links or "::" in name or not subject.links:
            continue
        if sort in LINK_TAGS:
            problem = f"<{tag.name}> is {name!r}, which names no link{closest(name, subject.links)}"
            yield Mistake(tag, problem, f"the links there are: {listed(list(subject.links))}")
        elif sort in FRAME_TAGS and (meant := nearest(name, subject.links)):
            yield Mistake(tag, f"<{tag.name}> is {name!r}, which names no link", f"write {meant}")


def plugin_joints(subject: Subject) -> Iterator[Mistake]:
    """Joints in plugins that are not there."""
    for tag, name in subject.plugin_joints:
        if name not in subject.joints and "::" not in name and subject.joints:
            problem = f"<{tag.name}> is {name!r}, which names no joint{closest(name, subject.joints)}"
            yield Mistake(tag, problem, f"the joints there are: {listed(list(subject.joints))}")


def two_drives(subject: Subject) -> Iterator[Mistake]:
    """A second plugin that drives the robot."""
    driving = [plugin for plugin in subject.plugins if plugin_name(plugin) in DRIVES]
    for plugin in driving[1:]:
        yield Mistake(plugin, f"{plugin} drives the robot, and so does {driving[0]}", "keep one of them")


def no_drive(subject: Subject) -> Iterator[Mistake]:
    """A robot on wheels that has plugin tags, and none that drives it. A file without any is a mere description."""
    controls = [tag for tag in subject.plugins if plugin_name(tag) in CONTROLS] + subject.root.all("ros2_control")
    wheels = [wheel for wheel in subject.wheels if wheel.sure]
    simulated = controls or subject.plugins or subject.root.all("gazebo")
    if not simulated or len(wheels) < 2 or _is_driven(subject):
        return
    problem = f"the robot has {len(wheels)} wheels and no plugin that drives it"
    if controls:
        problem += f"; nothing here reads {plugin_name(controls[0]) or controls[0].name}"
    mend = f"add <gazebo><plugin> with filename={_file(DRIVES[1])!r}, or spawn it with --drive planar_move"
    yield Mistake(controls[0] if controls else subject.root, problem, mend)


def _is_driven(subject: Subject) -> bool:
    names = [plugin_name(plugin) for plugin in subject.plugins]
    near = any(name in DRIVES or nearest(name, DRIVES, 6) for name in names)
    return near or (subject.model is not None and subject.model.drive is not None)


def plugin_name(plugin: Tag) -> str:
    """The plugin's file without folder, "lib", ".so", and what differs from one Gazebo to the next."""
    name = plugin.attributes.get("filename", "").strip().rpartition("/")[2].removeprefix("lib").removesuffix(".so")
    name = re.sub(r"^(ignition-gazebo\d*|gz-sim\d*)-", "gz-sim-", name)
    return name.removesuffix("-system") if name.startswith("gz-sim-") else name


def _file(name: str) -> str:
    return f"{name}-system" if name.startswith("gz-sim-") else f"lib{name}.so"


def _settings(subject: Subject) -> Iterator[Tag]:
    return (tag for plugin in subject.plugins for tag in plugin.children)
