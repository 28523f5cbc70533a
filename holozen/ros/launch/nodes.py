"""launch_ros: nodes, and what holds for those of a group."""

from typing import Any

from holozen.robot.errors import RobotError
from holozen.ros import executables
from holozen.ros.launch import values
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.entity import Action, Entities
from holozen.ros.launch.processes import TERMINALS, ExecuteProcess
from holozen.ros.launch.simulation import given, ours
from holozen.ros.launch.stand_ins import SCRIPTS, Wanted, leave_out, stand_in
from holozen.ros.launch.text import LaunchError, Text, pairs, text
from holozen.ros.launch.values import Parameter, ParameterFile, ParameterValue

__all__ = [
    "Node",
    "Parameter",
    "ParameterFile",
    "ParameterValue",
    "PushROSNamespace",
    "PushRosNamespace",
    "SetParameter",
    "SetParametersFromFile",
    "SetRemap",
    "SetUseSimTime",
]


class Node(ExecuteProcess):
    """Starts a Python script of a package by `holozen run`; for ROS's own nodes there are stand-ins."""

    def __init__(
        self, *, executable: Text = "", package: Text = "", name: Text = "", namespace: Text = "", exec_name: Text = "",
        parameters: Any = (), remappings: Any = (), ros_arguments: Any = (), arguments: Any = (),
        name_of_process: str = "", **others: Any,
    ) -> None:  # fmt: skip
        super().__init__(name=exec_name or name_of_process, **others)
        self.package, self.executable, self.node_name = package, executable, name
        self.namespace, self.parameters = namespace, parameters or ()
        self.remappings, self.arguments = pairs(remappings, "remappings", self.place), arguments or ()
        self.ros_arguments = ros_arguments or ()
        if not executable:
            raise LaunchError("Node lacks executable='...'", self.place)
        for what in ("arguments", "ros_arguments"):
            if isinstance(getattr(self, what), str):
                told = f"{what}={getattr(self, what)!r} is one text; write a list of words"
                raise LaunchError(told, self.place)

    def execute(self, context: LaunchContext) -> Entities | None:
        """Start it, or do what stands for it. Raises LaunchError."""
        package, executable = text(context, self.package), text(context, self.executable)
        words = [text(context, word) for word in self.arguments]
        try:
            texts, namespace = values.texts(context, self.parameters), text(context, self.namespace)
            done = stand_in(context, Wanted(self, package, executable, words, texts, namespace))
            if done is not None:
                return done
            prefix = text(context, self.prefix or "").partition(" ")[0]
            if prefix.rpartition("/")[2] in TERMINALS:
                where = f"run it in another terminal: holozen run {package} {executable}"
                leave_out(context, self, f"{package} {executable}", where)
                return None
            self._start(context, self._words(context, package, executable, words), self._called(context, executable))
        except RobotError as error:
            raise LaunchError(str(error), self.place) from None
        return None

    def _called(self, context: LaunchContext, executable: str) -> str:
        return text(context, self.name) or executable.rpartition("/")[2]

    def _words(self, context: LaunchContext, package: str, executable: str, words: list[str]) -> list[str]:
        own = SCRIPTS.get(f"{package}/{executable}")
        target = [str(own)] if own else [package, executable] if package else [executable]
        try:
            if package and not own:
                executables.find(package, executable, nameless=True)  # here, where the line of the launch file is known
        except executables.NotFound as error:
            raise LaunchError(str(error), self.place) from None
        return ours(context, "run", *given(*([] if own else [package])), *target, *words, *self._ros_words(context))

    def _ros_words(self, context: LaunchContext) -> list[str]:
        """ROS's own words: name, namespace, remappings and parameters, the group's first."""
        scope, found = context.scope, [text(context, word) for word in self.ros_arguments]
        if name := text(context, self.node_name):
            found += ["-r", f"__node:={name}"]
        if namespace := context.full_name("", text(context, self.namespace)):
            found += ["-r", f"__ns:=/{namespace}"]
        for old, new in (*self.remappings, *scope.remappings):
            found += ["-r", f"{text(context, old)}:={text(context, new)}"]
        found += values.words(context, [*scope.parameters, *self.parameters])
        return ["--ros-args", *found] if found else []


class PushROSNamespace(Action):
    """Puts the nodes to come, in this group, below a namespace."""

    def __init__(self, namespace: Text, **others: Any) -> None:
        super().__init__(**others)
        self.namespace = namespace

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.scope.namespace = context.full_name("", text(context, self.namespace))


PushRosNamespace = PushROSNamespace


class SetParameter(Action):
    """Gives the nodes to come, in this group, a parameter."""

    def __init__(self, name: Text, value: Any, **others: Any) -> None:
        super().__init__(**others)
        self.name, self.value = name, value

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.scope.parameters.append({text(context, self.name): values.found(context, self.value)})


class SetParametersFromFile(Action):
    """Gives the nodes to come, in this group, the parameters of a file."""

    def __init__(self, filename: Text, **others: Any) -> None:
        super().__init__(**others)
        self.filename = filename

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.scope.parameters.append(text(context, self.filename))


class SetRemap(Action):
    """Remaps a name of the nodes to come, in this group."""

    def __init__(self, src: Text, dst: Text, **others: Any) -> None:
        super().__init__(**others)
        self.src, self.dst = src, dst

    def execute(self, context: LaunchContext) -> None:
        """From here on."""
        context.scope.remappings.append((text(context, self.src), text(context, self.dst)))


class SetUseSimTime(SetParameter):
    """Has the nodes to come, in this group, go by the sim's time."""

    def __init__(self, value: Any, **others: Any) -> None:
        super().__init__("use_sim_time", value, **others)
