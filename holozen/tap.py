"""A reader of bytes: samples as they come, whatever is in them. Light: it loads nothing that takes time."""

from __future__ import annotations

import threading

from holozen.errors import BusError

TYPE_CHECKING = False  # importing `typing` takes 3 ms, which an echo would wait for
if TYPE_CHECKING:
    from typing import Any

PRIORITIES = ("REAL_TIME", "INTERACTIVE_HIGH", "INTERACTIVE_LOW", "DATA_HIGH", "DATA", "DATA_LOW", "BACKGROUND")
"""Zenoh's priorities, the strongest first; Zenoh counts them from 1."""


def source(node: str, session: str) -> str:
    """How the others name a node that sends to them."""
    return f"{node}@{session[:6]}"


def source_in(attachment: Any) -> str:
    """Who says, in the attachment of a sample or a request, to have sent it; empty if nobody does."""
    return bytes(attachment).decode(errors="replace")[:80] if attachment else ""


class Sample:
    """What arrived. `payload` is empty where `size`, in bytes, is over the reader's limit (0: there is none).

    Most readers want no more than the payload, so the rest is looked up in Zenoh's sample when it is asked for.
    """

    __slots__ = ("_sample", "encoding", "payload", "size")

    def __init__(self, sample: Any, limit: int = 0) -> None:
        payload = sample.payload
        self._sample, self.encoding, self.size = sample, str(sample.encoding), len(payload)
        self.payload = b"" if limit and self.size > limit else bytes(payload)

    @property
    def key(self) -> str:
        """The key it came on."""
        return str(self._sample.key_expr)

    @property
    def priority(self) -> str:
        """The name of its Zenoh priority."""
        return PRIORITIES[int(self._sample.priority) - 1]

    @property
    def source(self) -> str:
        """Who says to have sent it; empty if nobody does."""
        return source_in(self._sample.attachment)

    @property
    def number(self) -> tuple[str, int] | None:
        """Which of its publisher's samples it is: the publisher's id, and a count; None if it says nothing."""
        told = self._sample.source_info
        return told and (f"{told.source_id.zid}:{told.source_id.eid}", told.source_sn)

    @property
    def delivery(self) -> tuple[str, bool]:
        """What Zenoh does with it where a link is full ("DROP" or "BLOCK"), and whether it goes out at once."""
        return str(self._sample.congestion_control).rpartition(".")[2], bool(self._sample.express)


class Tap:
    """Raw samples, the newest of them if there were too many to read."""

    def __init__(self, subscriber: Any, limit: int = 0) -> None:
        # Reading from the handler leaves the subscriber free to be undeclared meanwhile.
        self.ends = [subscriber]  # what stands on the wire for this reader
        self._samples, self._limit = subscriber.handler, limit
        self.thread: threading.Thread | None = None  # the one that waits in `recv`

    def try_recv(self) -> Sample | None:
        """The next waiting sample, or None."""
        sample = self._samples.try_recv()
        return sample and Sample(sample, self._limit)

    def recv(self) -> Sample:
        """The next sample; waits for it. Raises BusError once the bus or this tap is closed."""
        self.thread = threading.current_thread()
        try:
            sample = self._samples.recv()
        except Exception:  # zenoh's own error type, which only bus.py may name: the session is closed
            raise BusError("closed") from None
        return Sample(sample, self._limit)

    def close(self) -> None:
        """Stop listening."""
        for end in self.ends:
            end.undeclare()
