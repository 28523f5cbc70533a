"""Parameters as launch files write them, as words for a node's command line."""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

from holozen.ros import yaml_values
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.text import LaunchError, Substitution, Text, text


class ParameterValue:
    """A parameter's value; `value_type` (str, int, float, bool) says what it is, whatever it looks like."""

    def __init__(self, value: Any, *, value_type: Any = None) -> None:
        self.value, self.value_type = value, value_type


class ParameterFile:
    """A YAML file of parameters. Substitutions inside of it are not looked at."""

    def __init__(self, param_file: Text, *, allow_substs: Any = False) -> None:
        self.param_file = param_file


class Parameter:
    """One parameter by name."""

    def __init__(self, name: Text, value: Any = None, *, value_type: Any = None, description: str = "") -> None:
        self.name, self.value = name, ParameterValue(value, value_type=value_type)


def words(context: LaunchContext, parameters: Any) -> Iterator[str]:
    """The words that give a node its parameters: dicts, Parameters, and files. Raises LaunchError."""
    for name, value in pairs(context, parameters):
        yield from ("-p", f"{name}:={written(value)}") if name else ("--params-file", str(value))


def texts(context: LaunchContext, parameters: Any) -> dict[str, str]:
    """Those parameters that are texts. Raises LaunchError."""
    return {name: value for name, value in pairs(context, parameters) if name and isinstance(value, str)}


def pairs(context: LaunchContext, parameters: Any) -> Iterator[tuple[str, Any]]:
    """Name and value of every parameter; a file has no name. Raises LaunchError."""
    if isinstance(parameters, Mapping | str) or not hasattr(parameters, "__iter__"):
        raise LaunchError(f"parameters={parameters!r:.80} is no list; write [{{'name': value}}, 'file.yaml']")
    for each in parameters:
        if isinstance(each, Mapping):
            yield from _flat(context, each, "")
        elif isinstance(each, Parameter):
            yield text(context, each.name), found(context, each.value)
        elif isinstance(each, ParameterFile):
            yield "", text(context, each.param_file)
        else:
            yield "", text(context, each)


def _flat(context: LaunchContext, values: Mapping[Any, Any], before: str) -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        name = before + text(context, key)
        if isinstance(value, Mapping):
            yield from _flat(context, value, f"{name}.")
        else:
            yield name, found(context, value)


def found(context: LaunchContext, value: Any) -> Any:
    """A parameter's value: what a substitution gives is read as YAML, a str stays one. Raises LaunchError."""
    if isinstance(value, ParameterValue):
        return _as(value.value_type, _text(context, value.value)) if value.value_type else found(context, value.value)
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Substitution) or (_is_list(value) and any(isinstance(each, Substitution) for each in value)):
        return _read(text(context, value))
    if _is_list(value):
        return [found(context, each) for each in value]
    raise LaunchError(f"a parameter cannot be {value!r:.80}; it is a bool, a number, a text, or a list of those")


def written(value: Any) -> str:
    """A value as YAML that reads as the same one."""
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    return json.dumps(value) if isinstance(value, bool | str) else repr(value)


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple)


def _text(context: LaunchContext, value: Any) -> str:
    return str(value) if isinstance(value, bool | int | float) else text(context, value)


def _read(word: str) -> Any:
    if word.lstrip().startswith("<"):
        return word  # a robot
    try:
        return yaml_values.value(word)
    except ValueError:
        return word


def _as(kind: Any, word: str) -> Any:
    if kind is str:
        return word
    value = _read(word)
    if kind is float and type(value) is int:
        return float(value)
    if isinstance(kind, type) and not isinstance(value, kind):
        raise LaunchError(f"the parameter is {word!r:.80}, no {kind.__name__}")
    return value
