"""What became of the commands of one robot: counted, and told at most once a second."""

import math
from collections import Counter
from collections.abc import Callable
from typing import TypeVar

from holozen.finite import not_finite
from holozen.messages import Message
from holozen.readers import Received
from holozen.tell import say

TELL_EVERY = 1.0  # s
M = TypeVar("M", bound=Message)


class Ledger:
    """Counts what was accepted and what was refused, by reason."""

    def __init__(self, say: Callable[[str], None] = say) -> None:
        self.accepted = 0
        self.refused: Counter[str] = Counter()
        self.last = ""
        self._say = say
        self._told = -math.inf
        self._untold = 0

    def open(self, received: Received[M], keys: tuple[str, ...], now: float) -> M | None:
        """The message of a sample on one of `keys`; None where there is no good one, which is counted."""
        kind, reason = _fault(received, keys)
        if kind:
            self.refuse(keys[0], kind, reason, source_of(received), now)
        return None if kind else received.message

    def refuse(self, key: str, kind: str, reason: str, source: str, now: float) -> None:
        """Count a refusal of what `source` sent on `key`."""
        self.refused[kind] += 1
        self.last = f"{source}: {reason}"[:300]
        self._untold += 1
        if now - self._told < TELL_EVERY:
            return
        more = f" (and {self._untold - 1} more)" if self._untold > 1 else ""
        self._say(f"{key}: from {self.last}{more}")
        self._told, self._untold = now, 0


def _fault(received: Received[M], keys: tuple[str, ...]) -> tuple[str, str]:
    """The kind of what is wrong with a sample, and what it is; both empty for a good one."""
    sample, message = received.sample, received.message
    if sample.key not in keys:
        return "wildcard", f"a command for {sample.key!r}; name one robot"
    if message is None:
        return "oversized" if received.error.startswith("oversized") else "malformed", received.error
    if bad := not_finite(message):
        return "not finite", f"{bad} is not a finite number"
    return "", ""


def source_of(received: Received[M]) -> str:
    """Who sent a sample."""
    return received.sample.source or f"anonymous ({received.sample.priority})"
