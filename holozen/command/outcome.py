"""What becomes of a command."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

UNKNOWN_CALLER = "an unknown caller"  # who set a stop whose request names nobody
OVER_LIMITS = "over the limits"  # begins the reason why a command was clamped, which is obeyed


class Outcome(Enum):
    """What becomes of a command. The value of a refusal is the word under which it is counted and
    reported.
    """

    DRIVES = "drives"
    STOPS = "stops"
    STOPPED = "stopped"
    MUST_LET_GO = "let go first"
    WAITS_FOR_RESUME = "held"
    OVERRULED = "overruled"
    VOID = "void"
    OLD = "old"
    HELD_UP = "late"
    OUT_OF_ORDER = "out of order"
    GONE = "gone"
    NO_ECHO = "no echo"
    UNSTAMPED = "unstamped"

    @property
    def is_obeyed(self) -> bool:
        """Whether the command drives or stops the robot."""
        return self in (Outcome.DRIVES, Outcome.STOPS)


class Decision(NamedTuple):
    """An outcome. The `reason` of a refusal says what happened and what to do; it is empty for an
    obeyed command.
    """

    outcome: Outcome
    reason: str = ""


def refusal(outcome: Outcome, why: str) -> Decision:
    """A refusal whose reason begins with the word of its outcome."""
    return Decision(outcome, f"{outcome.value}: {why}")
