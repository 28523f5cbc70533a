"""Reads MCAP files, which may be truncated, damaged or malicious."""

import dataclasses
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, McapError, RecordLengthLimitExceeded
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, DataEnd, Header, McapRecord, Schema
from mcap.records import Message as MessageRecord
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk, read_magic
from mcap.writer import MCAP0_MAGIC

from holozen.bags import ENCODING, ZENOH, BagError, Channel, Message
from holozen.messages import encoding_of

LARGEST = 256 << 20  # bytes of a record, compressed and uncompressed
NAMES = 64 << 20  # bytes of all schemas and channels of a file
LIBRARY = "holozen"


class McapFile:
    """An MCAP file to read.

    Once its messages are read, `cut_off` is true if its end is missing, and `numbered` if the
    numbers of its messages include lost ones.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.cut_off, self.numbered = path, False, False
        try:
            self._stream = path.open("rb")
        except OSError as error:
            raise BagError(f"cannot read {path}: {error.strerror}") from None
        self.size = path.stat().st_size  # bytes

    def close(self) -> None:
        """Close it."""
        self._stream.close()

    def messages(self) -> Iterator[Message]:
        """All messages, in the order of the file. Raises BagError at damage."""
        types: dict[int, str] = {0: ""}
        channels: dict[int, Channel] = {}
        room = NAMES
        for record in self._records():
            match record:
                case Header():
                    self.numbered = record.library == LIBRARY
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
                raise BagError(
                    f"{self.path}: its schemas and channels take more than {NAMES} bytes"
                )

    def _records(self) -> Iterator[McapRecord]:
        """The records up to the end of the data, out of their chunks."""
        self._stream.seek(0)
        whole: Any = _WholeReads(self._stream, self.size)
        reader = _Records(whole, skip_magic=True, emit_chunks=True, record_size_limit=LARGEST)
        try:
            read_magic(ReadDataStream(whole))
        except (InvalidMagic, EndOfFile):
            raise BagError(
                f"{self.path} is not an MCAP file{'' if self.size else ': it is empty'}"
            ) from None
        try:
            for record in reader.records:
                if isinstance(record, DataEnd):
                    return
                yield from _opened(record) if isinstance(record, Chunk) else [record]
        except EndOfFile:
            self._stream.seek(max(len(MCAP0_MAGIC), self.size - len(MCAP0_MAGIC)))
            if self._stream.read() == MCAP0_MAGIC:  # the file is complete
                raise self._damaged("a record is longer than the file, or has no kind") from None
            self.cut_off = True
        except RecordLengthLimitExceeded as error:
            raise BagError(f"{self.path}: {error}") from None
        except CRCValidationError:
            raise self._damaged("the checksum is wrong") from None
        except (McapError, ValueError, struct.error, KeyError) as error:
            raise self._damaged(str(error) or type(error).__name__) from None

    def _damaged(self, why: str) -> BagError:
        return BagError(
            f"{self.path} is damaged before byte {self._stream.tell()}: {' '.join(why.split())}"
        )


class _Records(StreamReader):
    """Records up to the first whose kind is 0, which none has: zeros are the end of a file that was
    not written.
    """

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        if opcode == 0:
            raise EndOfFile
        return super()._read_record(opcode, length)


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
        return breakup_chunk(
            dataclasses.replace(chunk, compression="", data=data), validate_crc=True
        )
    except (EndOfFile, struct.error):
        raise ValueError("a record is longer than its chunk") from None


def _decompressed(data: bytes, compression: str, size: int) -> bytes:
    """The data of a chunk. At most `size` + 1 bytes are decompressed, since a few bytes could
    expand without limit.
    """
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
    encoding = record.metadata.get(ENCODING)
    if not encoding:  # of another program
        encoding = (
            encoding_of("cdr", kind) if form == "cdr" else ZENOH.get(form, form or "zenoh/bytes")
        )
    # Topics of ROS begin with a slash, keys of Zenoh do not.
    return Channel(record.topic.removeprefix("/"), encoding, form, kind)
