"""What tests of commands put in the place of other processes."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TypeVar

import zenoh

from holozen.messages import Message
from holozen.transport.pubsub import Received
from holozen.transport.samples import PRIORITIES

M = TypeVar("M", bound=Message)


@dataclass
class FakeSenders:
    """Sessions whose clocks run `offset` seconds ahead of ours, which is known up to `error` seconds.

    `asked` are the sessions that were to be asked again.
    """

    offset: float = 5000.0
    error: float = 0.0
    there: set[str] = field(default_factory=lambda: {"aa", "bb"})
    known: set[str] = field(default_factory=lambda: {"aa", "bb"})
    answers: dict[str, float] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)
    tracked: list[str] = field(default_factory=list)

    def has(self, session: str) -> bool:
        return session in self.there

    def ages(self, session: str, sent: float, now: float, _member: str) -> tuple[float, float] | None:
        age = now - (sent - self.offset)
        return (max(0.0, age - self.error), age + self.error) if session in self.known else None

    def track_first(self, session: str, now: float) -> None:
        self.tracked.append(session)

    def answered(self, session: str) -> float:
        return self.answers.get(session, -1.0)

    def ask_now(self, session: str, now: float) -> None:
        self.asked.append(session)


def received(
    message: M | None, attachment: str, priority: str = "DATA", key: str = "Fred/cmd_vel", error: str = ""
) -> Received[M]:
    """A sample as Zenoh hands it over, with its message."""
    rank = PRIORITIES.index(priority) + 1
    sample = SimpleNamespace(
        key_expr=key, payload=zenoh.ZBytes(b""), encoding="", priority=rank, attachment=attachment.encode()
    )
    made: Received[M] = Received(sample)
    made.message, made.error = message, error
    return made
