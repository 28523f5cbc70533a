"""What tests of commands put in the place of other processes."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TypeVar

import zenoh

from holozen.messages import Message
from holozen.transport.pubsub import Received
from holozen.transport.samples import PRIORITIES, Echo

M = TypeVar("M", bound=Message)


ROBOT = "cc"  # the session of the receiver


@dataclass
class FakeSenders:
    """Sessions that are `there`, and a receiver whose own time is that of the test."""

    there: set[str] = field(default_factory=lambda: {"aa", "bb"})
    beats: int = 0  # sent at once

    def has(self, session: str) -> bool:
        return session in self.there

    def echo(self, echoes: tuple[Echo, ...]) -> int | None:
        return dict(echoes).get(ROBOT)

    def age(self, beat: int, now: float) -> float:
        return now - beat * 1e-9

    def beat_now(self) -> None:
        self.beats += 1


def stamp(number: int, sent: float, session: str = "aa", node: str = "me") -> str:
    """The attachment of a command that echoes the beat of the time `sent` (s)."""
    return f"{node}@{session};{number};{ROBOT}:{round(sent * 1e9)}"


def received(
    message: M | None,
    attachment: str,
    priority: str = "DATA",
    key: str = "Fred/cmd_vel",
    error: str = "",
) -> Received[M]:
    """A sample as Zenoh hands it over, with its message."""
    rank = PRIORITIES.index(priority) + 1
    sample = SimpleNamespace(
        key_expr=key,
        payload=zenoh.ZBytes(b""),
        encoding="",
        priority=rank,
        attachment=attachment.encode(),
    )
    made: Received[M] = Received(sample)
    made.message, made.error = message, error
    return made
