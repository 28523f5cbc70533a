"""The writing side of a key: messages out, and the last one for whoever asks."""

from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from holozen.messages import Message

M = TypeVar("M", bound="Message")


class Publisher(Generic[M]):
    """Writes messages, and answers a `get` on its key with the last one. Made by `Bus.publisher`.

    Each goes out with the sender's name, and with its number, by which a reader knows how many were lost. `number`
    makes what Zenoh takes for that (SourceInfo).
    """

    def __init__(self, publisher: Any, wire: str, source: str, number: Callable[[int], Any]) -> None:
        from holozen import codec

        self.ends = [publisher]  # what stands on the wire for this publisher
        self._publisher, self._wire, self._source = publisher, wire, source.encode()
        self._written, self._named, self._encoding = codec.written, codec.encoding, publisher.encoding
        self._last: tuple[bytes, Any] | None = None  # with its Encoding
        self._numbers = map(number, count())

    @property
    def matched(self) -> bool:
        """Whether anyone subscribes to this key."""
        return bool(self._publisher.matching_status.matching)

    def put(self, message: M) -> None:
        """Send one message. A number that is not finite raises codec.CodecError, or the message is sent as CDR, as its
        type says.
        """
        payload, wire = self._written(message, self._wire)
        self.put_bytes(payload, None if wire == self._wire else self._named(wire, type(message)))

    def put_bytes(self, payload: bytes, encoding: str | None = None) -> None:
        """Send what is encoded already, by default for the wire of this publisher."""
        self._last = payload, encoding or self._encoding
        self._publisher.put(payload, encoding=encoding, attachment=self._source, source_info=next(self._numbers))

    def answer(self, query: Any) -> None:
        """Reply with the last message. Runs in Zenoh's thread, and so does nothing else."""
        with query:
            if self._last is not None:
                payload, encoding = self._last
                query.reply(self._publisher.key_expr, payload, encoding=encoding)

    def close(self) -> None:
        """Stop writing and answering; nothing of this key stays."""
        for end in self.ends:
            end.undeclare()
