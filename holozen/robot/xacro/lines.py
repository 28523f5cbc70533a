"""XML elements that know their file and line, in the documents that the xacro library reads and copies."""

from collections.abc import Callable
from typing import Any, NamedTuple
from xml.dom import expatbuilder, minidom

from holozen.robot.errors import RobotError, cut


class Place(NamedTuple):
    """Where an element stands."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"


def place_of(node: Any) -> Place | None:
    """Where `node` was written, also when it is a copy."""
    return getattr(node, "place", None)


def keep_places(file: Callable[[], str]) -> None:
    """From now on each element that minidom reads gets its place; `file` says what is being read.

    It patches minidom for the whole process. Entity declarations are refused, as in `tag.read_xml`.
    """
    builder: Any = expatbuilder.ExpatBuilderNS
    dom: Any = minidom
    start, copy = builder.start_element_handler, dom._clone_node

    def started(self: Any, name: str, attributes: Any) -> None:
        start(self, name, attributes)
        self.curNode.place = Place(file(), self.getParser().CurrentLineNumber)

    def entity(self: Any, name: str, *_rest: object) -> None:
        place = Place(file(), self.getParser().CurrentLineNumber)
        raise RobotError(f"{place}: the entity {cut(name)} is declared; write its text out instead")

    def copied(node: Any, deep: bool, owner: Any) -> Any:
        clone = copy(node, deep, owner)
        if place := place_of(node):
            clone.place = place
        return clone

    builder.start_element_handler, builder.entity_decl_handler, dom._clone_node = started, entity, copied
