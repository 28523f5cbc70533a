"""The one error of this folder."""

from holozen.console import Failure
from holozen.suggest import shorten

MOST = 2000  # characters of a message


class RobotError(Failure, ValueError):
    """A robot cannot be used as written. One line: where, what is wrong, what is allowed, what to do.

    Messages that are long in spite of `cut` and `listed` are truncated to MOST characters.
    """

    def __init__(self, message: str) -> None:
        super().__init__(shorten(message, MOST))
