"""The error that this package raises."""

from holozen.console import Failure
from holozen.suggest import shorten

MAX_MESSAGE = 2000  # characters of a message


class RobotError(Failure, ValueError):
    """A robot cannot be used as written. One line: where, what is wrong, what is allowed, what to
    do.

    A message is truncated to MAX_MESSAGE characters.
    """

    def __init__(self, message: str) -> None:
        super().__init__(shorten(message, MAX_MESSAGE))
