"""The one table of the command line's verbs: what each is for, where it is, what it needs, and as
whom it acts.
"""

from collections.abc import Mapping
from typing import NamedTuple

SCRIPT, VIEWER, OPERATOR, AUTOPILOT, SIM, ROUTER = (
    "script",
    "viewer",
    "operator",
    "autopilot",
    "sim",
    "router",
)
"""The roles of the secure set-up."""


class Row(NamedTuple):
    """A verb of the command line.

    about: Its line of `holozen --help`; of a noun, the verbs that follow it.
    module: Where it is: a table VERBS of Verb and Noun, or `main(argv)` and `parser()` of a
        service.
    extra: The extra of pyproject.toml that installs what it needs; empty if it needs nothing.
    role: Whose certificate it uses in the secure set-up; empty: it needs none.
    roles: Those of the verbs that follow it where they differ.
    is_noun: Whether a verb has to follow.
    verbs: Those that may follow the name of a service, with their modules.
    """

    about: str
    module: str
    role: str = SCRIPT
    roles: Mapping[str, str] = {}
    extra: str = ""
    is_noun: bool = False
    verbs: Mapping[str, str] = {}

    @property
    def package(self) -> str:
        """The package that it belongs to, such as `holozen.cli`, or `holozen.bags` of an
        extension.
        """
        return ".".join(self.module.split(".")[:2])


VERBS = {
    "up": Row(
        "start the sim, the controller, the pose service, and the teleop in this terminal",
        "holozen.cli.up",
        "",
    ),
    "stop": Row(
        "stop robots, all of them or some, until they are released", "holozen.cli.stop", OPERATOR
    ),
    "release": Row("let stopped robots drive again", "holozen.cli.stop", OPERATOR),
    "sim": Row(
        "simulate robots; pause, play, step, reset",
        "holozen.sim.__main__",
        SIM,
        roles=dict.fromkeys(("pause", "play", "step", "reset"), OPERATOR),
        verbs=dict.fromkeys(("pause", "play", "step", "reset"), "holozen.cli.simulation"),
        extra="sim",
    ),
    "teleop": Row("drive a robot from the keyboard", "holozen.teleop.__main__", OPERATOR),
    "controller": Row(
        "drive a robot to the goals of next_goal", "holozen.controller.__main__", AUTOPILOT
    ),
    "camera": Row(
        "render what the cameras of robots see; the sim starts it",
        "holozen.camera.__main__",
        SIM,
        extra="camera",
    ),
    "view": Row(
        "show the robots in a browser, and drive them from there",
        "holozen.view.__main__",
        OPERATOR,
        extra="view",
    ),
    "pose-service": Row(
        "answer next_goal and get_pose", "holozen.pose_service.__main__", AUTOPILOT
    ),
    "router": Row("run a Zenoh router", "holozen.cli.router", ROUTER),
    "ros2": Row("join ROS 2 nodes, by rmw_zenoh or a bridge to DDS", "holozen.ros.cli.ros2"),
    "secure": Row(
        "init, add, renew, revoke, page, show", "holozen.secure.cli", is_noun=True, extra="secure"
    ),
    "run": Row(
        "run a Python script that was written for ROS 2", "holozen.ros.cli.run", extra="run"
    ),
    "launch": Row(
        "run a Python launch file that was written for ROS 2",
        "holozen.ros.cli.launch",
        extra="launch",
    ),
    "spawn": Row(
        "put a robot or object into the running sim", "holozen.cli.spawn", OPERATOR, extra="spawn"
    ),
    "delete": Row("remove robots or objects from the sim", "holozen.cli.robot", OPERATOR),
    "list": Row(
        "list the robots and objects in the sim, and where they are", "holozen.cli.robot", VIEWER
    ),
    "xacro": Row("expand a xacro file", "holozen.cli.xacro", OPERATOR, extra="xacro"),
    "new": Row("robot, controller, package", "holozen.cli.new", is_noun=True),
    "check": Row("report what is wrong with a robot file", "holozen.check.cli", extra="check"),
    "topic": Row(
        "list, info, type, find, echo, pub, hz, bw, delay, plot",
        "holozen.cli.topic",
        VIEWER,
        roles={"pub": SCRIPT},
        is_noun=True,
    ),
    "service": Row(
        "list, type, find, info, call",
        "holozen.cli.service",
        VIEWER,
        roles={"call": SCRIPT},
        is_noun=True,
    ),
    "action": Row("list, type, info, send_goal", "holozen.cli.action", is_noun=True),
    "node": Row("list, info", "holozen.cli.node", VIEWER, is_noun=True),
    "param": Row(
        "list, get, set, describe, dump, load",
        "holozen.cli.param",
        VIEWER,
        roles={"set": OPERATOR, "load": OPERATOR},
        is_noun=True,
    ),
    "tf": Row("echo", "holozen.cli.tf", VIEWER, is_noun=True),
    "doctor": Row(
        "diagnose problems on this machine and among the nodes, and suggest fixes",
        "holozen.doctor.cli",
        VIEWER,
    ),
    "graph": Row("show which nodes write, read and serve which keys", "holozen.cli.node", VIEWER),
    "completion": Row("print a completion script for bash, zsh or fish", "holozen.cli.completion"),
    "interface": Row("list, show, proto", "holozen.cli.interface", is_noun=True),
    "record": Row(
        "record keys into a bag (MCAP)", "holozen.bags.cli.record", VIEWER, extra="record"
    ),
    "replay": Row(
        "publish the messages of a bag again, at their times",
        "holozen.bags.cli.replay",
        extra="replay",
    ),
    "bag": Row(
        "info, plot, record, play",
        "holozen.bags.cli.bag",
        roles={"record": VIEWER},
        is_noun=True,
        extra="bag",
    ),
    "plot": Row("draw fields of live messages in the terminal", "holozen.cli.plot", VIEWER),
    "map": Row(
        "draw the robots, their paths and their goals in the terminal", "holozen.cli.plot", VIEWER
    ),
}

EXTRA_OF = {"cryptography": "secure", "mujoco": "mujoco"}
"""Library that a flag of several verbs needs -> the extra that installs it; others are in the extra
of their verb.
"""


def role(name: str) -> str:
    """The role of a verb, such as `up` or `topic pub`."""
    noun, _, verb = name.partition(" ")
    row = VERBS[noun]
    return row.roles.get(verb, row.role)
