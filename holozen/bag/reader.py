"""Reads and summarizes bags, which may be truncated, damaged or malicious."""

import dataclasses
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple, Self

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, McapError, RecordLengthLimitExceeded
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, DataEnd, Header, McapRecord, Schema
from mcap.records import Message as MessageRecord
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk, read_magic
from mcap.writer import MCAP0_MAGIC

from holozen.bag import ENCODING, BagError

LARGEST = 256 << 20  # bytes of a record, compressed and uncompressed
NAMES = 64 << 20  # bytes of all schemas and channels of a file
LIBRARY = "holozen"
# The Encodings of MCAP's message encodings, for bags of other programs, which note no Zenoh Encoding.
_ZENOH = {"json": "application/json", "msgpack": "application/msgpack", "cdr": "application/cdr",
    "protobuf": "application/protobuf", "": "zenoh/bytes"}  # fmt: skip


class Channel(NamedTuple):
    """A stream of a bag: its key, Zenoh Encoding, MCAP encoding and type (empty if unknown)."""

    key: str
    encoding: str
    format: str
    type: str


class Message(NamedTuple):
    """A message. `at`: when it was recorded, in ns since 1970 or of the sim's time. `number` counts the messages of its
    channel, including lost ones.
    """

    channel: Channel
    at: int
    payload: bytes
    number: int = 0


class Bag:
    """A file to read.

    After its messages were read, `cut_off` is true if its end is missing, and `numbered` if the numbers of its
    messages include lost ones.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.cut_off, self.numbered, self.profile = path, False, False, ""
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
        """All messages, in the order of the file. Raises BagError at damage."""
        types: dict[int, str] = {0: ""}
        channels: dict[int, Channel] = {}
        room = NAMES
        for record in self._records():
            match record:
                case Header():
                    self.profile, self.numbered = record.profile, record.library == LIBRARY
                case Schema():
                    types[record.id] = record.name
                    room -= len(record.name) + len(record.data)
                case ChannelRecord():
                    channels[record.id] = _channel(record, types)
                    room -= len(record.topic) + len(str(record.metadata))
                case MessageRecord():
                    if (channel := channels.get(record.channel_id)) is None:
                        raise self._damaged("a message without a channel")
                    yield Message(channel, record.log_time, record.data, record.sequence)
            if room < 0:
                raise BagError(f"{self.path}: its schemas and channels take more than {NAMES} bytes")

    def _records(self) -> Iterator[McapRecord]:
        """The records up to the end of the data, out of their chunks."""
        self._stream.seek(0)
        whole: Any = _WholeReads(self._stream, self.size)
        reader = StreamReader(whole, skip_magic=True, emit_chunks=True, record_size_limit=LARGEST)
        try:
            read_magic(ReadDataStream(whole))
        except (InvalidMagic, EndOfFile):
            raise BagError(f"{self.path} is not an MCAP file{'' if self.size else ': it is empty'}") from None
        try:
            for record in reader.records:
                if isinstance(record, DataEnd):
                    return
                yield from _opened(record) if isinstance(record, Chunk) else [record]
        except EndOfFile:
            self._stream.seek(max(len(MCAP0_MAGIC), self.size - len(MCAP0_MAGIC)))
            if self._stream.read() == MCAP0_MAGIC:  # the file is complete
                raise self._damaged("a record is longer than the file") from None
            self.cut_off = True
        except RecordLengthLimitExceeded as error:
            raise BagError(f"{self.path}: {error}") from None
        except CRCValidationError:
            raise self._damaged("the checksum is wrong") from None
        except (McapError, ValueError, struct.error, KeyError) as error:
            raise self._damaged(str(error) or type(error).__name__) from None

    def _damaged(self, why: str) -> BagError:
        return BagError(f"{self.path} is damaged before byte {self._stream.tell()}: {' '.join(why.split())}")


class _WholeReads:
    """A stream that returns exactly as many bytes as requested, or raises EndOfFile."""

    def __init__(self, stream: IO[bytes], size: int) -> None:
        self._stream, self._size = stream, size

    def read(self, count: int) -> bytes:
        """The next `count` bytes. Nothing is allocated for bytes that the file does not have."""
        if not 0 <= count <= self._size - self._stream.tell():
            raise EndOfFile
        return self._stream.read(count)


def _opened(chunk: Chunk) -> list[McapRecord]:
    """The records of a chunk. Raises ValueError."""
    if chunk.uncompressed_size > LARGEST:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes; at most {LARGEST} are read")
    data = _decompressed(chunk.data, chunk.compression, chunk.uncompressed_size)
    try:
        return breakup_chunk(dataclasses.replace(chunk, compression="", data=data), validate_crc=True)
    except (EndOfFile, struct.error):
        raise ValueError("a record is longer than its chunk") from None


def _decompressed(data: bytes, compression: str, size: int) -> bytes:
    """The data of a chunk. At most `size` + 1 bytes are decompressed, since a few bytes could expand without limit."""
    if compression == "zstd":
        import zstandard

        try:
            with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(data) as reader:
                data = reader.read(size + 1)
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from None
    elif compression == "lz4":
        import lz4.frame

        try:
            data = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
        except RuntimeError as error:
            raise ValueError(str(error)) from None
    elif compression:
        raise ValueError(f"unknown compression {compression[:20]!r}; known: zstd, lz4")
    if len(data) != size:
        raise ValueError("a chunk does not have the size it claims")
    return data


def _channel(record: ChannelRecord, types: dict[int, str]) -> Channel:
    form = record.message_encoding
    kind = record.metadata.get("type") or types.get(record.schema_id, "")
    # Topics of ROS begin with a slash, keys of Zenoh do not.
    return Channel(record.topic.removeprefix("/"), record.metadata.get(ENCODING) or _ZENOH.get(form, form), form, kind)


@dataclass
class Stream:
    """The messages of one channel. Times in ns."""

    channel: Channel
    count: int = 0
    bytes: int = 0
    first: int = 0
    last: int = 0
    longest: int = 0  # between two messages
    missing: int = 0  # lost messages, by the gaps in their numbers
    _number: int = -1

    def see(self, message: Message, numbered: bool = True) -> None:
        """Add a message."""
        if self.count:
            self.longest = max(self.longest, message.at - self.last)
        else:
            self.first = message.at
        if numbered:
            self.missing += max(0, message.number - self._number - 1)
            self._number = message.number
        self.count, self.bytes, self.last = self.count + 1, self.bytes + len(message.payload), message.at

    @property
    def rate(self) -> float:
        """Messages per second; 0 with fewer than two."""
        return (self.count - 1) / (self.last - self.first) * 1e9 if self.last > self.first else 0.0

    def figures(self) -> dict[str, object]:
        """For people and JSON; times in seconds."""
        return {
            "key": self.channel.key,
            "type": self.channel.type,
            "encoding": self.channel.encoding,
            "messages": self.count,
            "missing": self.missing,
            "bytes": self.bytes,
            "rate": round(self.rate, 3),
            "longest_gap": round(self.longest / 1e9, 4),
        }


@dataclass
class Summary:
    """All channels of a bag. Times in ns."""

    path: str
    size: int
    streams: dict[Channel, Stream] = field(default_factory=dict)
    cut_off: bool = False

    @property
    def count(self) -> int:
        """The number of messages."""
        return sum(stream.count for stream in self.streams.values())

    @property
    def start(self) -> int:
        """The time of the first message."""
        return min((stream.first for stream in self.streams.values()), default=0)

    @property
    def end(self) -> int:
        """The time of the last message."""
        return max((stream.last for stream in self.streams.values()), default=0)

    def figures(self) -> dict[str, object]:
        """For JSON; times in seconds."""
        return {
            "file": self.path,
            "bytes": self.size,
            "messages": self.count,
            "start": self.start / 1e9,
            "duration": (self.end - self.start) / 1e9,
            "cut_off": self.cut_off,
            "topics": [stream.figures() for stream in self._sorted()],
        }

    def lines(self) -> list[str]:
        """For people."""
        size = f"{self.size / 1e6:.2f} MB" if self.size >= 1e4 else f"{self.size} bytes"
        head = f"{self.path}: {size}, {self.count} messages in {(self.end - self.start) / 1e9:.2f} s"
        lines = [head + (f", from {_date(self.start)}" if self.count else "")]
        if self.cut_off:
            lines.append("the recording was cut off: the end of the file is missing; everything listed here is usable")
        return lines + _table([stream.figures() for stream in self._sorted()])

    def _sorted(self) -> list[Stream]:
        return sorted(self.streams.values(), key=lambda stream: stream.channel)


def summarize(bag: Bag) -> Summary:
    """Read a bag from start to end. Raises BagError."""
    summary = Summary(str(bag.path), bag.size)
    for message in bag.messages():
        if (stream := summary.streams.get(message.channel)) is None:
            stream = summary.streams[message.channel] = Stream(message.channel)
        stream.see(message, bag.numbered)
    summary.cut_off = bag.cut_off
    return summary


def _table(rows: list[dict[str, object]]) -> list[str]:
    if not rows:
        return []
    cells = [["key", "type", "encoding", "messages", "missing", "rate", "longest gap"]]
    for row in rows:
        rate = f"{row['rate']:.2f} Hz" if row["rate"] else ""
        words = [row["key"], row["type"] or "?", row["encoding"], row["messages"], row["missing"], rate]
        cells.append([*map(str, words), f"{row['longest_gap']} s"])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return ["  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip() for row in cells]


def _date(at: int) -> str:
    try:
        return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at / 1e9))
    except (OverflowError, ValueError, OSError):
        return f"{at / 1e9:.3f} s"
