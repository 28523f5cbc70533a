"""Classes made of a definition's text, and what they refuse."""

from typing import Any

import pytest

from holozen.messages.definitions import Interface, parse
from holozen.messages.registry import Registry
from holozen.ros import generated


def made(text: str, name: str = "t/msg/T") -> Any:
    """The class of a definition."""
    (section,) = parse(text, "here", Registry().find)
    return generated.make(Interface(name, "msg", *section))


def refused(message: Any, name: str, value: Any) -> str:
    with pytest.raises(AssertionError) as error:
        setattr(message, name, value)
    with pytest.raises(AssertionError) as same:
        type(message)(**{name: value})
    assert str(same.value) == str(error.value)
    assert "\n" not in str(error.value)
    return str(error.value)
