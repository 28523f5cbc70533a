"""Substitutions that are true or false."""

from typing import Any

from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.text import Substitution, Text, text, truth


class EqualsSubstitution(Substitution):
    """true if two texts are the same, else false."""

    def __init__(self, left: Any, right: Any) -> None:
        self.left, self.right = left, right

    def perform(self, context: LaunchContext) -> str:
        """true or false."""
        return _word(_text(context, self.left) == _text(context, self.right))


class NotEqualsSubstitution(EqualsSubstitution):
    """false if two texts are the same, else true."""

    def perform(self, context: LaunchContext) -> str:
        """true or false."""
        return _word(_text(context, self.left) != _text(context, self.right))


class NotSubstitution(Substitution):
    """true for false, and false for true."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def perform(self, context: LaunchContext) -> str:
        """true or false. Raises LaunchError for what is neither."""
        return _word(not truth(context, self.value, "what NotSubstitution turns round"))


class AndSubstitution(Substitution):
    """true if both are."""

    def __init__(self, left: Any, right: Any) -> None:
        self.left, self.right = left, right

    def perform(self, context: LaunchContext) -> str:
        """true or false. Raises LaunchError for what is neither."""
        return _word(all(self._sides(context)))

    def _sides(self, context: LaunchContext) -> list[bool]:
        return [truth(context, side, f"a side of {type(self).__name__}") for side in (self.left, self.right)]


class OrSubstitution(AndSubstitution):
    """true if one of two is."""

    def perform(self, context: LaunchContext) -> str:
        """true or false. Raises LaunchError for what is neither."""
        return _word(any(self._sides(context)))


class IfElseSubstitution(Substitution):
    """One of two texts, as a third one says true or false."""

    def __init__(self, condition: Any, if_value: Text = "", else_value: Text = "") -> None:
        self.condition, self.if_value, self.else_value = condition, if_value, else_value

    def perform(self, context: LaunchContext) -> str:
        """The text. Raises LaunchError."""
        holds = truth(context, self.condition, "the condition of IfElseSubstitution")
        return text(context, self.if_value if holds else self.else_value)


def _text(context: LaunchContext, value: Any) -> str:
    return _word(value) if isinstance(value, bool) else str(value) if value is None else text(context, value)


def _word(value: bool) -> str:
    return str(value).lower()
