"""What of the controller can be set, by flags and while it drives: each with its unit and range."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from holozen.parameters import Number

from .goto import Gains


class Knob(NamedTuple):
    """One of the Gains by the name that people use."""

    name: str
    field: str
    low: float
    high: float
    unit: str
    about: str

    @property
    def flag(self) -> str:
        """Its command-line flag."""
        return "--" + self.name.replace("_", "-")


KNOBS = (
    Knob("max_speed", "max_speed", 0.01, 10, "m/s", "the fastest it drives"),
    Knob("max_turn", "max_turn", 0.01, 20, "rad/s", "the fastest it turns"),
    Knob("max_acceleration", "max_acceleration", 0.01, 100, "m/s^2", "how fast it changes its speed"),
    Knob("gain", "linear", 0.1, 10, "1/s", "speed for each metre that is left"),
    Knob("turn_gain", "angular", 0.1, 10, "1/s", "turn for each radian that is left"),
    Knob("tolerance", "tolerance", 0.001, 1, "m", "how near it has to come to a goal"),
    Knob("angle_tolerance", "angle_tolerance", 0.001, 1, "rad", "how well it has to be turned there"),
)


def declared(read: Callable[[], Gains], write: Callable[[Gains], None]) -> Iterator[Number]:
    """The knobs as parameters of Gains that `read` gives and `write` takes."""
    for knob in KNOBS:
        yield Number(
            knob.name, knob.about, knob.unit, knob.low, knob.high,
            partial(_get, read, knob.field), partial(_set, read, write, knob.field),
        )  # fmt: skip


def _get(read: Callable[[], Gains], field: str) -> float:
    value: float = getattr(read(), field)
    return value


def _set(read: Callable[[], Gains], write: Callable[[Gains], None], field: str, value: float) -> None:
    write(replace(read(), **{field: value}))
