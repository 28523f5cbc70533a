"""The replies of many, as they come."""

from __future__ import annotations

from holozen.errors import BusError
from holozen.tap import Sample

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any


class Replies:
    """The replies to `Bus.ask` and `ask_all`, each a sample or the bytes of an error."""

    def __init__(self, replies: Any) -> None:
        self._replies = replies

    def try_recv(self) -> Sample | bytes | None:
        """The next that waits, or None. Raises BusError once there will be no more."""
        try:
            reply = self._replies.try_recv()
        except Exception:  # zenoh's own error type, which only bus.py may name: all have replied, or the time is over
            raise BusError("no more replies") from None
        return reply and _read(reply)

    def __iter__(self) -> Iterator[Sample | bytes]:
        """All of them, waiting for each."""
        return map(_read, self._replies)


def _read(reply: Any) -> Sample | bytes:
    return Sample(reply.ok) if reply.ok else bytes(reply.err.payload)
