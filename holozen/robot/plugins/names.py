"""What a plugin is, by its `filename` or, for gz-sim, its `name`."""

import re

from holozen.robot.tag import Tag

_GZ_FILE = re.compile(r"(?:gz-sim|ignition-gazebo)\d*-(.+)-system")
_GZ_CLASS = re.compile(r"(?:gz::sim|ignition::gazebo)::(?:v\d+::)?systems::(\w+)")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def kind_of(plugin: Tag) -> str:
    """`gazebo_ros_diff_drive` for libgazebo_ros_diff_drive.so, `gz:diff-drive` for gz-sim's and ignition's DiffDrive,
    whether told by its file or by its class; empty for a plugin without a file name.
    """
    stem = file_of(plugin).rpartition("/")[2].removeprefix("lib").removesuffix(".so")
    system, name = _GZ_FILE.fullmatch(stem), _GZ_CLASS.fullmatch(plugin.attributes.get("name", "").strip())
    if system:
        return f"gz:{system[1]}"
    return f"gz:{_HUMP.sub('-', name[1]).lower()}" if name else stem


def file_of(plugin: Tag) -> str:
    """What the file calls it."""
    return plugin.attributes.get("filename", "").strip()
