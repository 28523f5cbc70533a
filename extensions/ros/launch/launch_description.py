"""LaunchDescription and Action: the parts of a launch file, each with the file and line where it is
written.
"""

import inspect
from collections.abc import Iterable, Sequence
from typing import Any

from holozen.ros.launch.launch_context import LaunchContext, LaunchError, here
from holozen.suggest import suggest

Entities = Sequence["LaunchDescriptionEntity"]


class LaunchDescriptionEntity:
    """A part of a launch file; `place` is its file and line."""

    place = ""

    def visit(self, context: LaunchContext) -> Entities:
        """Execute it; returns the entities to execute next."""
        return ()


class LaunchDescription(LaunchDescriptionEntity):
    """All entities of a launch file, in order."""

    def __init__(
        self, initial_entities: Iterable[Any] | None = None, *, deprecated_reason: str | None = None
    ) -> None:
        self.place = here()
        self.entities = checked(initial_entities or (), self.place)

    def visit(self, context: LaunchContext) -> Entities:
        """Its entities."""
        return self.entities

    def add_entity(self, entity: Any) -> None:
        """Append an entity."""
        self.entities += checked([entity], here())

    add_action = add_entity


class Condition:
    """Decides whether an action is executed."""

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it holds now. Raises LaunchError."""
        return True


class Action(LaunchDescriptionEntity):
    """Something to execute if its condition holds."""

    def __init__(self, *, condition: Any = None, **others: Any) -> None:
        self.place = here()
        if others:
            raise LaunchError(_unknown_argument(type(self), next(iter(others))), self.place)
        if condition is not None and not isinstance(condition, Condition):
            raise LaunchError(
                f"condition={condition!r} is not a condition; write IfCondition(...)", self.place
            )
        self.condition = condition

    def visit(self, context: LaunchContext) -> Entities:
        """Execute it if its condition holds. Raises LaunchError."""
        if self.condition is not None and not self.condition.evaluate(context):
            return ()
        return self.execute(context) or ()

    def execute(self, context: LaunchContext) -> Entities | None:
        """Execute it; returns the entities to execute next. Raises LaunchError."""
        ...


def checked(entities: Any, place: str) -> list[LaunchDescriptionEntity]:
    """Entities of a launch file as a list. Raises LaunchError for anything that is not one."""
    if isinstance(entities, LaunchDescriptionEntity):
        return [entities]
    found = (
        list(entities)
        if isinstance(entities, Iterable) and not isinstance(entities, str)
        else [entities]
    )
    for entity in found:
        if not isinstance(entity, LaunchDescriptionEntity):
            raise LaunchError(
                f"{entity!r:.80} is not an action; write Node(...), LogInfo(...) and so on", place
            )
    return found


OTHER_NAMES = {
    "pkg": "package",
    "type": "executable",
    "exec": "executable",
    "ns": "namespace",
    "args": "arguments",
}
"""A word of ROS's XML launch files -> the argument in Python."""


def _unknown_argument(kind: type, word: str) -> str:
    names = {
        name
        for each in kind.__mro__
        if issubclass(each, Action) and "__init__" in vars(each)
        for name, parameter in inspect.signature(each).parameters.items()
        if parameter.kind is not parameter.VAR_KEYWORD
    }
    if (new := OTHER_NAMES.get(word, word.removeprefix("node_"))) != word and new in names:
        return (
            f"{kind.__name__} has no argument {word!r}, which is its name in XML or an older "
            f"ROS; write {new}=..."
        )
    return (
        f"{kind.__name__} has no argument {word!r}{suggest(word, names)}; arguments: "
        f"{', '.join(sorted(names))}"
    )
