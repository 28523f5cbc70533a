"""The writing side of a key: messages out, and the last one for whoever asks."""

from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from holozen.messages import Message

M = TypeVar("M", bound="Message")


class Publisher(Generic[M]):
    """Writes messages, and answers a `get` on its key with the last one. Made by `Bus.publisher`."""

    def __init__(self, publisher: Any, wire: str, source: str) -> None:
        from holozen import codec

        self.ends = [publisher]  # what stands on the wire for this publisher
        self._publisher, self._wire, self._source = publisher, wire, source.encode()
        self._encode, self._encoding = codec.encode, codec.WIRES[wire]
        self._last: bytes | None = None

    @property
    def matched(self) -> bool:
        """Whether anyone subscribes to this key."""
        return bool(self._publisher.matching_status.matching)

    def put(self, message: M) -> None:
        """Send one message. Raises codec.CodecError if it holds a number that is not finite."""
        self._last = self._encode(message, self._wire)
        self._publisher.put(self._last, attachment=self._source)

    def answer(self, query: Any) -> None:
        """Reply with the last message. Runs in Zenoh's thread, and so does nothing else."""
        with query:
            if self._last is not None:
                query.reply(self._publisher.key_expr, self._last, encoding=self._encoding)

    def close(self) -> None:
        """Stop writing and answering; nothing of this key stays."""
        for end in self.ends:
            end.undeclare()
