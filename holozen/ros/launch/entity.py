"""What a launch file is made of."""

from collections.abc import Iterable, Sequence
from typing import Any

from holozen.flags import nearest
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.text import LaunchError, here

Entities = Sequence["LaunchDescriptionEntity"]


class LaunchDescriptionEntity:
    """Something that a launch file says; `place` is the file and line that do."""

    place = ""

    def visit(self, context: LaunchContext) -> Entities:
        """Do it; returns what is to be done next."""
        return ()


class LaunchDescription(LaunchDescriptionEntity):
    """Everything that a launch file says, in order."""

    def __init__(self, initial_entities: Iterable[Any] | None = None, *, deprecated_reason: str | None = None) -> None:
        self.place = here()
        self.entities = checked(initial_entities or (), self.place)

    def visit(self, context: LaunchContext) -> Entities:
        """Its entities."""
        return self.entities

    def add_entity(self, entity: Any) -> None:
        """Say one thing more."""
        self.entities += checked([entity], here())

    def add_action(self, action: Any) -> None:
        """Say one thing more."""
        self.entities += checked([action], here())


class Condition:
    """Says whether an action is done."""

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it holds now. Raises LaunchError."""
        return True


class Action(LaunchDescriptionEntity):
    """Something to be done, if its condition holds."""

    def __init__(self, *, condition: Any = None, **others: Any) -> None:
        self.place = here()
        if others:
            raise LaunchError(_unknown(type(self), next(iter(others))), self.place)
        if condition is not None and not isinstance(condition, Condition):
            raise LaunchError(f"condition={condition!r} is no condition; write IfCondition(...)", self.place)
        self.condition = condition

    def visit(self, context: LaunchContext) -> Entities:
        """Do it if its condition holds. Raises LaunchError."""
        if self.condition is not None and not self.condition.evaluate(context):
            return ()
        return self.execute(context) or ()

    def execute(self, context: LaunchContext) -> Entities | None:
        """Do it; returns what is to be done next. Raises LaunchError."""
        return None


def checked(entities: Any, place: str) -> list[LaunchDescriptionEntity]:
    """Entities of a launch file. Raises LaunchError that names what is none."""
    if isinstance(entities, LaunchDescriptionEntity):
        return [entities]
    found = list(entities) if isinstance(entities, Iterable) and not isinstance(entities, str) else [entities]
    for entity in found:
        if not isinstance(entity, LaunchDescriptionEntity):
            raise LaunchError(f"{entity!r:.80} is no action; actions are such as Node(...) and LogInfo(...)", place)
    return found


def _unknown(kind: type, word: str) -> str:
    names = {name for each in kind.__mro__[:-1] for name in _arguments(each)} - {"self", "others"}
    if (new := word.removeprefix("node_")) != word and new in names:
        return f"{kind.__name__} has no argument {word!r}, which is ROS's old word; write {new}=..."
    return f"{kind.__name__} has no argument {word!r}{nearest(word, names)}; it has {', '.join(sorted(names))}"


def _arguments(kind: type) -> tuple[str, ...]:
    code = getattr(vars(kind).get("__init__"), "__code__", None)
    return code.co_varnames[: code.co_argcount + code.co_kwonlyargcount] if code else ()
