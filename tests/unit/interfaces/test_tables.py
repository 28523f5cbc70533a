"""Our tables say what ROS 2 says, and our own messages have exactly those fields."""

import typing
from typing import Any

import msgspec
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from holozen import messages, simulation_interfaces
from holozen.cdr.structs import ros_name
from holozen.interfaces import Field, Interface, Registry
from holozen.interfaces.definition import FLOATS, INTEGERS
from holozen.interfaces.values import prototype
from holozen.messages import Message

REGISTRY = Registry()
ALL = REGISTRY.names()
JAZZY = get_typestore(Stores.ROS2_JAZZY).fielddefs
KINDS = sorted(
    {
        kind
        for module in (messages, simulation_interfaces)
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, Message) and kind is not Message
    },
    key=ros_name,
)
OF_ROS = {
    "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "rcl_interfaces", "rosgraph_msgs",
    "sensor_msgs", "std_msgs", "tf2_msgs", "trajectory_msgs", "visualization_msgs",
}  # fmt: skip


def spelled(kind: Any) -> str:
    """A field's type as rosbags describes it, in the words of a .msg file."""
    node, inner = kind
    if node in (Nodetype.BASE, Nodetype.NAME):
        return str(inner[0] if node == Nodetype.BASE else inner)
    element, bound = inner
    ends = f"[{bound}]" if node == Nodetype.ARRAY else f"[<={bound}]" if bound else "[]"
    return spelled(element) + ends


def full(field: Field) -> str:
    return field._replace(type=field.type.replace("/msg/", "|")).spelled().replace("|", "/msg/")


@pytest.mark.parametrize("name", [name for name in ALL if "/msg/" in name and name.partition("/")[0] in OF_ROS])
def test_a_type_of_ros_has_its_fields_and_constants(name: str) -> None:
    constants, fields = JAZZY[name]
    ours = REGISTRY.find(name)
    theirs = [(field, spelled(kind)) for field, kind in fields if field != "structure_needs_at_least_one_member"]
    assert [(field.name, full(field)) for field in ours.fields] == theirs
    assert [(each.name, each.type, each.value) for each in ours.constants] == [tuple(each) for each in constants]


def test_no_message_of_those_packages_is_left_out() -> None:
    theirs = {name for name in JAZZY if name.partition("/")[0] in OF_ROS}
    assert theirs - set(ALL) == set()


@pytest.mark.parametrize("name", ALL)
def test_every_type_of_our_tables_can_be_found(name: str) -> None:
    assert REGISTRY.find(name).name == name


@pytest.mark.parametrize("kind", KINDS, ids=ros_name)
def test_each_message_of_ours_has_exactly_the_fields_of_its_definition(kind: type[Message]) -> None:
    interface = REGISTRY.find(ros_name(kind))
    hints = typing.get_type_hints(kind)
    assert kind.__struct_fields__ == tuple(field.name for field in interface.fields)
    for field in interface.fields:
        assert fits(hints[field.name], field), f"{field.name}: {hints[field.name]} is no {field.spelled()}"


def is_of_a_reply(kind: type[Message]) -> bool:
    """Whether a field says that all went well, which is what our own replies begin with."""
    return bool({"result", "success"} & set(kind.__struct_fields__))


@pytest.mark.parametrize("kind", [kind for kind in KINDS if not is_of_a_reply(kind)], ids=ros_name)
def test_each_message_of_ours_has_the_defaults_of_its_definition(kind: type[Message]) -> None:
    ours = msgspec.to_builtins(kind())
    if kind is messages.CommandStatus:
        ours["refused"] = list(ours["refused"].items())
    assert ours == prototype(REGISTRY.find(ros_name(kind)))


def fits(hint: Any, field: Field) -> bool:
    """Whether a Struct's field can hold what a definition's field is."""
    if typing.get_origin(hint) is dict:
        key, value = typing.get_args(hint)
        pair = field.nested.fields if field.nested else ()
        return field.array == "sequence" and fits(key, pair[0]) and fits(value, pair[1])
    if typing.get_origin(hint) is list:
        return bool(field.array) and fits(typing.get_args(hint)[0], field._replace(array=""))
    if field.nested:
        return not field.array and issubclass(hint, Message) and ros_name(hint) == field.nested.name
    python = {"bool": bool, "string": str} | dict.fromkeys(INTEGERS, int) | dict.fromkeys(FLOATS, float)
    return not field.array and hint is python[field.type]


def test_the_check_above_sees_a_wrong_type() -> None:
    nested = Interface("a/msg/B", "msg")
    assert not fits(int, Field("a", "float64"))
    assert not fits(float, Field("a", "float64", "sequence"))
    assert not fits(list[float], Field("a", "float64"))
    assert not fits(messages.Twist, Field("a", nested.name, nested=nested))
