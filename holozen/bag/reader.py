"""The messages of a bag, from a file that may be cut off, damaged or hostile."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Self

from holozen.bag import ENCODING
from holozen.bag.errors import BagError
from holozen.bag.records import CHANNEL, HEADER, MESSAGE, SCHEMA, Record, blob, records, text

NAMES = 64 << 20  # bytes that all schemas and channels of a file may take
# What stands for MCAP's message encodings where no Zenoh Encoding was noted: bags of other programs.
_ZENOH = {"json": "application/json", "msgpack": "application/msgpack", "cdr": "application/cdr",
    "protobuf": "application/protobuf", "": "zenoh/bytes"}  # fmt: skip
_MESSAGE = struct.Struct("<HIQQ")


class Channel(NamedTuple):
    """A stream of a bag: its key, Zenoh Encoding, MCAP encoding and type (empty if nobody knows)."""

    key: str
    encoding: str
    form: str
    type: str


class Message(NamedTuple):
    """One message. `at`: when it was recorded, in ns since 1970, or since whatever its clock began."""

    channel: Channel
    at: int
    payload: bytes


class Bag:
    """A file to read. `cut_off` is known once its messages were read: it has no end, but all before can be used."""

    def __init__(self, path: Path) -> None:
        self.path, self.cut_off, self.profile = path, False, ""
        try:
            self._stream = path.open("rb")
        except OSError as error:
            raise BagError(f"cannot read {path}: {error.strerror}") from None
        self.size = path.stat().st_size  # bytes

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._stream.close()

    def messages(self) -> Iterator[Message]:
        """All messages, in the order of the file. Raises BagError where it is damaged."""
        names = _Names(self.path)
        for record in records(self._stream, self.path):
            if record is None:
                self.cut_off = True
            elif record.kind == MESSAGE:
                yield names.message(record)
            elif record.kind == HEADER:
                self.profile = names.profile(record)
            else:
                names.learn(record)


class _Names:
    """The schemas and channels of a file, by their numbers."""

    def __init__(self, path: Path) -> None:
        self._path, self._room = path, NAMES
        self._types: dict[int, str] = {0: ""}
        self._channels: dict[int, Channel] = {}

    def profile(self, record: Record) -> str:
        try:
            return text(record.body, 0)[0]
        except ValueError as error:
            raise self._damaged(record, error) from None

    def learn(self, record: Record) -> None:
        self._room -= len(record.body)
        if self._room < 0:
            raise BagError(f"{self._path}: its schemas and channels take more than {NAMES} bytes")
        try:
            number = int.from_bytes(record.body[:2], "little")
            if record.kind == SCHEMA:
                self._types[number] = text(record.body, 2)[0]
            elif record.kind == CHANNEL:
                self._channels[number] = self._channel(record.body)
        except ValueError as error:
            raise self._damaged(record, error) from None

    def message(self, record: Record) -> Message:
        try:
            number, _, at, _ = _MESSAGE.unpack_from(record.body)
            return Message(self._channels[number], at, record.body[_MESSAGE.size :])
        except (struct.error, KeyError):
            raise self._damaged(record, "a message of no channel") from None

    def _channel(self, body: bytes) -> Channel:
        topic, at = text(body, 4)
        form, at = text(body, at)
        metadata = _pairs(blob(body, at)[0])
        kind = metadata.get("type") or self._types.get(int.from_bytes(body[2:4], "little"), "")
        # Keys of Zenoh have no leading slash, topics of ROS do.
        return Channel(topic.removeprefix("/"), metadata.get(ENCODING) or _ZENOH.get(form, form), form, kind)

    def _damaged(self, record: Record, why: object) -> BagError:
        return BagError(f"{self._path} is damaged at byte {record.at}: {why}")


def _pairs(body: bytes) -> dict[str, str]:
    found, at = {}, 0
    while at < len(body):
        name, at = text(body, at)
        found[name], at = text(body, at)
    return found
