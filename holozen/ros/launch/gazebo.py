"""What Gazebo's own launch files mean here: those of gazebo_ros and of ros_gz_sim start our sim."""

from collections.abc import Callable
from pathlib import Path

from holozen.flags import nearest
from holozen.ros import packages
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action, Entities, LaunchDescription
from holozen.ros.launch.simulation import Simulation, gz_world
from holozen.ros.launch.text import LaunchError
from holozen.tell import say

NOWHERE = Path("/holozen-stands-in-for")  # the folder of packages that are only names

NO_WINDOW = "launch: Gazebo's window is left out; `holozen map` in another terminal shows the robots"


class _Classic(Action):
    """gazebo.launch.py and gzserver.launch.py."""

    def execute(self, context: LaunchContext) -> Entities:
        """Our sim in the world that the argument says."""
        context.used.update(CLASSIC)
        return [Simulation(context.launch_configurations.get("world", ""), self)]


class _NoWindow(Action):
    """gzclient.launch.py."""

    def execute(self, context: LaunchContext) -> None:
        """Say that there is no window."""
        context.used.update(CLASSIC)
        say(NO_WINDOW)


class _New(Action):
    """gz_sim.launch.py."""

    def execute(self, context: LaunchContext) -> Entities:
        """Our sim in the world that the arguments say."""
        context.used.update(NEW)
        values = context.launch_configurations
        words = " ".join(values.get(name, "") for name in ("gz_args", "ign_args"))
        return [Simulation(gz_world(words), self)] if "-g" not in words.split() else [_NoWindow()]


CLASSIC = (
    "world", "gui", "server", "verbose", "pause", "headless", "server_required", "gui_required", "physics", "debug",
    "extra_gazebo_args", "init", "factory", "force_system", "recording", "use_sim_time", "params_file",
)  # fmt: skip
NEW = ("gz_args", "ign_args", "gz_version", "ign_version", "on_exit_shutdown", "debugger")
"""Arguments that Gazebo's launch files have, of which the world is the one that means something here."""

FILES: dict[str, dict[str, Callable[[], Action]]] = {
    "gazebo_ros": {"gazebo.launch.py": _Classic, "gzserver.launch.py": _Classic, "gzclient.launch.py": _NoWindow},
    "ros_gz_sim": {"gz_sim.launch.py": _New},
    "ros_ign_gazebo": {"ign_gazebo.launch.py": _New},
}
"""The launch files that we stand in for, by package."""


def stand_in() -> None:
    """Make the packages known, unless they are really there."""
    packages.stand_ins.update({name: NOWHERE / name for name in FILES})


def description(path: Path) -> LaunchDescription | None:
    """What one of Gazebo's launch files means here; None for any other file. Raises LaunchError."""
    if path.parts[: len(NOWHERE.parts)] != NOWHERE.parts:
        return None
    package = path.parts[len(NOWHERE.parts)]
    known = FILES[package]
    if path.name not in known or path.parent.name != "launch":
        hint = nearest(path.name, known) or f"; there are {', '.join(known)}"
        raise LaunchError(f"{package} is only stood in for here, and has no {'/'.join(path.parts[3:])!r}{hint}")
    return LaunchDescription([known[path.name]()])
