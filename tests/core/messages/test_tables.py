"""The definitions are those of ROS 2, and those of our Structs are made from them."""

import re
from pathlib import Path
from typing import Any

import msgspec
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from holozen.messages import CommandStatus, Message
from holozen.messages.action import ActionPart
from holozen.messages.definitions import Field, prototype
from holozen.messages.registry import TABLES, Registry
from holozen.messages.struct_cdr import interface
from scripts import text_of_structs

REGISTRY = Registry()
ALL = REGISTRY.names()
JAZZY = get_typestore(Stores.ROS2_JAZZY).fielddefs
OF_ROS = {
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "tf2_msgs",
    "trajectory_msgs",
    "visualization_msgs",
}


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


def test_every_type_of_ros_has_its_fields_and_constants() -> None:
    for name in (name for name in ALL if "/msg/" in name and name.partition("/")[0] in OF_ROS):
        constants, fields = JAZZY[name]
        ours = REGISTRY.find(name)
        theirs = [
            (field, spelled(kind))
            for field, kind in fields
            if field != "structure_needs_at_least_one_member"
        ]
        assert [(field.name, full(field)) for field in ours.fields] == theirs, name
        assert [(each.name, each.type, each.value) for each in ours.constants] == [
            tuple(each) for each in constants
        ]


def test_no_message_of_those_packages_is_left_out() -> None:
    theirs = {name for name in JAZZY if name.partition("/")[0] in OF_ROS}
    assert theirs - set(ALL) == set()


def test_every_type_of_our_tables_can_be_found() -> None:
    assert [REGISTRY.find(name).name for name in ALL] == ALL


def test_the_definitions_of_our_structs_are_those_that_the_script_writes() -> None:
    assert (Path(TABLES) / "structs.txt").read_text() == text_of_structs.text(), (
        "run scripts/definitions"
    )


def test_each_type_is_defined_once() -> None:
    structs = set(re.findall(r"^\[(.*)\]$", text_of_structs.text(), re.MULTILINE))
    texts = {
        path.stem: path.read_text() for path in Path(TABLES).glob("*.txt") if path.stem != "structs"
    }
    written = [
        f"{package}/{name}"
        for package in texts
        for name in re.findall(r"^\[(.*/.*)\]$", texts[package], re.MULTILINE)
    ]
    assert len(written) == len(set(written))
    assert not structs & set(written)


def test_each_struct_has_the_defaults_of_its_definition() -> None:
    kinds = {*Message.__subclasses__(), *ActionPart.__subclasses__()} - {ActionPart}
    for kind in (kind for kind in kinds if kind.__module__.startswith("holozen.messages.")):
        ours = msgspec.to_builtins(kind())
        if kind is CommandStatus:
            ours["refused"] = list(ours["refused"].items())
        assert ours == prototype(interface(kind)), kind
