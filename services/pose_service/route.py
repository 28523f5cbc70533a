"""The goals that are handed out: a shape of some size, which can be changed while the service runs, or a file's."""

from collections.abc import Iterator
from pathlib import Path

from holozen.errors import ServiceError
from holozen.messages import NextGoalReply, NextGoalRequest
from holozen.parameters import Choice, Number, Parameter

from .shapes import SHAPES, Goal, read_goals

SIZES = (0.01, 1000.0)  # m


def next_goal(goals: list[Goal], request: NextGoalRequest) -> NextGoalReply:
    """The goal with the number asked for, counted from 0. Raises ServiceError past either end of the list."""
    number = request.request_goal
    if not 0 <= number < len(goals):
        raise ServiceError(f"goal {number}: the list holds goals 0 to {len(goals) - 1}")
    x, y, theta = goals[number]
    return NextGoalReply(x, y, theta, int(number == len(goals) - 1))


class Route:
    """Goals of a `file`, or without one of a `shape` with `size` metres. Raises GoalsError for a bad file."""

    def __init__(self, shape: str, size: float, file: Path | None = None) -> None:
        self._shape, self._size, self._file = shape, size, file
        self.goals = read_goals(file) if file else SHAPES[shape](size)

    def next_goal(self, request: NextGoalRequest) -> NextGoalReply:
        """The goal with the number asked for. Raises ServiceError past either end of the list."""
        return next_goal(self.goals, request)

    def declared(self) -> Iterator[Parameter]:
        """Its parameters; goals of a file stay as they are."""
        if self._file:
            file = str(self._file)
            yield Choice("goals", "the file of the goals", (), lambda: file)
            return
        yield Choice(
            "shape", "the way round the goals, from the next request on", tuple(SHAPES), lambda: self._shape,
            lambda shape: self._draw(shape, self._size),
        )  # fmt: skip
        yield Number(
            "size", "its side (infinity: half its length)", "m", *SIZES, lambda: self._size,
            lambda size: self._draw(self._shape, size),
        )  # fmt: skip

    def _draw(self, shape: str, size: float) -> None:
        self._shape, self._size, self.goals = shape, size, SHAPES[shape](size)
