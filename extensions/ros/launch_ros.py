"""launch_ros: nodes, their parameters, and settings for the nodes of a group."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from holozen import parameter_yaml
from holozen.ros.executables import NotFound
from holozen.ros.launch.actions import ExecuteProcess
from holozen.ros.launch.launch_context import (
    LaunchContext,
    LaunchError,
    Substitution,
    Text,
    pairs,
    text,
)
from holozen.ros.launch.launch_description import Action, Entities
from holozen.ros.launch.stand_ins import Executable, skip, stand_in, undone
from holozen.suggest import article

__all__ = [
    "ComposableNode",
    "ComposableNodeContainer",
    "LifecycleNode",
    "LoadComposableNodes",
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


class ParameterValue:
    """The value of a parameter. `value_type` (str, int, float, bool) overrides the type it looks
    like.
    """

    def __init__(self, value: Any, *, value_type: Any = None) -> None:
        self.value, self.value_type = value, value_type


class ParameterFile:
    """A YAML file of parameters. Substitutions inside it are not evaluated."""

    def __init__(self, param_file: Text, *, allow_substs: Any = False) -> None:
        self.param_file = param_file


class Parameter:
    """One parameter with its name."""

    def __init__(
        self, name: Text, value: Any = None, *, value_type: Any = None, description: str = ""
    ) -> None:
        self.name, self.value = name, ParameterValue(value, value_type=value_type)


class Node(ExecuteProcess):
    """Starts a Python script of a package by `holozen run`; ROS's own nodes are replaced."""

    def __init__(
        self,
        *,
        executable: Text = "",
        package: Text = "",
        name: Text = "",
        namespace: Text = "",
        exec_name: Text = "",
        parameters: Any = (),
        remappings: Any = (),
        ros_arguments: Any = (),
        arguments: Any = (),
        **others: Any,
    ) -> None:
        super().__init__(name=exec_name, **others)
        self.package, self.executable, self.node_name = package, executable, name
        self.namespace, self.parameters = namespace, parameters or ()
        self.remappings, self.arguments = (
            pairs(remappings, "remappings", self.place),
            arguments or (),
        )
        self.ros_arguments = ros_arguments or ()
        if not executable:
            raise LaunchError("Node lacks executable='...'", self.place)
        for argument in ("arguments", "ros_arguments"):
            if isinstance(value := getattr(self, argument), str):
                raise LaunchError(
                    f"{argument}={value!r} is one text; write a list of words", self.place
                )

    def execute(self, context: LaunchContext) -> Entities | None:
        """Start it, or its replacement. Raises LaunchError."""
        package, executable = text(context, self.package), text(context, self.executable)
        words = [text(context, word) for word in self.arguments]
        values = list(parameter_pairs(context, self.parameters))
        texts = {name: value for name, value in values if name and isinstance(value, str)}
        files = [value for name, value in values if not name]
        remaps = {text(context, old): text(context, new) for old, new in self._remappings(context)}
        node = Executable(
            self, package, executable, words, texts, text(context, self.namespace), files, remaps
        )
        return self._run_node(context, node, text(context, self.name), self._ros_words(context))

    def _remappings(self, context: LaunchContext) -> list[tuple[Any, Any]]:
        """Its own, before those of its group."""
        return [*self.remappings, *context.scope.remappings]

    def _ros_words(self, context: LaunchContext) -> list[str]:
        """The ROS arguments: name, namespace, remappings and parameters, those of the group
        first.
        """
        scope, found = context.scope, [text(context, word) for word in self.ros_arguments]
        if name := text(context, self.node_name):
            found += ["-r", f"__node:={name}"]
        if namespace := context.full_name("", text(context, self.namespace)):
            found += ["-r", f"__ns:=/{namespace}"]
        for old, new in self._remappings(context):
            found += ["-r", f"{text(context, old)}:={text(context, new)}"]
        for name, value in parameter_pairs(context, [*scope.parameters, *self.parameters]):
            found += (
                ["-p", f"{name}:={parameter_yaml.written(value)}"]
                if name
                else ["--params-file", str(value)]
            )
        return ["--ros-args", *found] if found else []


class LifecycleNode(Node):
    """A node that a manager configures and activates. There are none here, so a simulation goes on
    without it.
    """

    def __init__(self, *, autostart: Any = False, **others: Any) -> None:
        super().__init__(**others)

    def _run_node(
        self,
        context: LaunchContext,
        node: Executable,
        name: str,
        ros_words: list[str] | None = None,
    ) -> Entities | None:
        replacement = stand_in(context, node)
        if replacement is None:
            skip(
                context,
                self,
                node.shown,
                "it is a lifecycle node, and none run here",
                lacks=undone(node),
            )
        return replacement


class ComposableNode:
    """A node that ROS loads into a container as a C++ plugin; here it runs as a Node if there is a
    script like it.
    """

    def __init__(
        self,
        *,
        package: Text,
        plugin: Text,
        name: Text = "",
        namespace: Text = "",
        parameters: Any = (),
        remappings: Any = (),
        extra_arguments: Any = (),
        condition: Any = None,
    ) -> None:
        self.node = _Component(
            package=package,
            executable=_Plugin(plugin),
            name=name,
            namespace=namespace,
            parameters=parameters,
            remappings=remappings,
            condition=condition,
        )


class _Component(Node):
    """The node of a plugin, whose package need not have a script for it."""

    def _run_node(
        self,
        context: LaunchContext,
        node: Executable,
        name: str,
        ros_words: list[str] | None = None,
    ) -> Entities | None:
        try:
            return super()._run_node(context, node, name, ros_words)
        except NotFound:
            skip(
                context,
                self,
                node.shown,
                "it is a component in C++, which does not run here",
                lacks=undone(node),
            )
            return None


class _Plugin(Substitution):
    """The usual name of the program for a plugin: joy_driver for drivers::JoyDriver."""

    def __init__(self, plugin: Text) -> None:
        self.plugin = plugin

    def _text(self, context: LaunchContext) -> str:
        return re.sub(
            r"(?<=[a-z0-9])(?=[A-Z])", "_", text(context, self.plugin).rpartition("::")[2]
        ).lower()


class LoadComposableNodes(Action):
    """Starts each of its nodes."""

    def __init__(
        self, *, composable_node_descriptions: Any, target_container: Any = None, **others: Any
    ) -> None:
        super().__init__(**others)
        self.nodes = _nodes(composable_node_descriptions, self.place)

    def execute(self, context: LaunchContext) -> Entities:
        return self.nodes


class ComposableNodeContainer(Node):
    """Starts each of its nodes as a process of its own; there is no container."""

    def __init__(self, *, composable_node_descriptions: Any = None, **others: Any) -> None:
        super().__init__(**others)
        self.nodes = _nodes(composable_node_descriptions or (), self.place)

    def execute(self, context: LaunchContext) -> Entities:
        """Its nodes. Actions that wait for the start of the container go on."""
        context.runner.skip(self, ends=False)
        return self.nodes


def _nodes(descriptions: Any, place: str) -> list[Node]:
    wrong = next((each for each in descriptions if not isinstance(each, ComposableNode)), None)
    if wrong is not None:
        raise LaunchError(f"{wrong!r:.80} is not a ComposableNode(package=..., plugin=...)", place)
    return [each.node for each in descriptions]


class PushROSNamespace(Action):
    """Puts later nodes of this group into a namespace."""

    def __init__(self, namespace: Text, **others: Any) -> None:
        super().__init__(**others)
        self.namespace = namespace

    def execute(self, context: LaunchContext) -> None:
        context.scope.namespace = context.full_name("", text(context, self.namespace))


PushRosNamespace = PushROSNamespace


class SetParameter(Action):
    """Gives later nodes of this group a parameter."""

    def __init__(self, name: Text, value: Any, **others: Any) -> None:
        super().__init__(**others)
        self.name, self.value = name, value

    def execute(self, context: LaunchContext) -> None:
        context.scope.parameters.append(
            {text(context, self.name): parameter_value(context, self.value)}
        )


class SetParametersFromFile(Action):
    """Gives later nodes of this group the parameters of a file."""

    def __init__(self, filename: Text, **others: Any) -> None:
        super().__init__(**others)
        self.filename = filename

    def execute(self, context: LaunchContext) -> None:
        context.scope.parameters.append(text(context, self.filename))


class SetRemap(Action):
    """Remaps a name of later nodes of this group."""

    def __init__(self, src: Text, dst: Text, **others: Any) -> None:
        super().__init__(**others)
        self.src, self.dst = src, dst

    def execute(self, context: LaunchContext) -> None:
        context.scope.remappings.append((text(context, self.src), text(context, self.dst)))


class SetUseSimTime(SetParameter):
    """Makes later nodes of this group use the time of the sim."""

    def __init__(self, value: Any, **others: Any) -> None:
        super().__init__("use_sim_time", value, **others)


def parameter_pairs(context: LaunchContext, parameters: Any) -> Iterator[tuple[str, Any]]:
    """Name and value of every parameter; a file has an empty name. Raises LaunchError."""
    if isinstance(parameters, Mapping | str) or not hasattr(parameters, "__iter__"):
        raise LaunchError(
            f"parameters={parameters!r:.80} is not a list; write [{{'name': value}}, 'file.yaml']"
        )
    for each in parameters:
        if isinstance(each, Mapping):
            yield from _flattened(context, each, "")
        elif isinstance(each, Parameter):
            yield text(context, each.name), parameter_value(context, each.value)
        elif isinstance(each, ParameterFile):
            yield "", text(context, each.param_file)
        else:
            yield "", text(context, each)


def parameter_value(context: LaunchContext, value: Any) -> Any:
    """The value of a parameter: a substitution is parsed as YAML, a str stays one. Raises
    LaunchError.
    """
    if isinstance(value, ParameterValue):
        if not value.value_type:
            return parameter_value(context, value.value)
        word = (
            str(value.value)
            if isinstance(value.value, bool | int | float)
            else text(context, value.value)
        )
        return _converted(value.value_type, word)
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Substitution) or (
        _is_list(value) and any(isinstance(each, Substitution) for each in value)
    ):
        return _parsed(text(context, value))
    if _is_list(value):
        return [parameter_value(context, each) for each in value]
    raise LaunchError(
        f"a parameter cannot be {value!r:.80}; it must be a bool, a number, a text, or a list of "
        "those"
    )


def _flattened(
    context: LaunchContext, values: Mapping[Any, Any], prefix: str
) -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        name = prefix + text(context, key)
        if isinstance(value, Mapping):
            yield from _flattened(context, value, f"{name}.")
        else:
            yield name, parameter_value(context, value)


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple)


def _parsed(word: str) -> Any:
    if word.lstrip().startswith("<"):
        return word  # a robot description
    try:
        return parameter_yaml.parse(word)
    except ValueError:
        return word


def _converted(kind: Any, word: str) -> Any:
    if kind is str:
        return word
    value = _parsed(word)
    if kind is float and type(value) is int:
        return float(value)
    if isinstance(kind, type) and not isinstance(value, kind):
        raise LaunchError(f"the parameter is {word!r:.80}, not {article(kind.__name__)}")
    return value
