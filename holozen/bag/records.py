"""The records of an MCAP file, one by one, in bounded memory, whatever the file holds.

Layout: https://mcap.dev/spec. Only what is needed to play and sum up: schemas, channels, chunks and messages.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from holozen.bag.errors import BagError

MAGIC = b"\x89MCAP0\r\n"
LARGEST = 256 << 20  # bytes of a record, packed and unpacked
HEADER, SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 0x01, 0x03, 0x04, 0x05, 0x06, 0x0F
WANTED = {HEADER, SCHEMA, CHANNEL, MESSAGE, CHUNK}

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQI")


class Record(NamedTuple):
    """A record's kind and content. `at`: the byte of the file where it begins, or where its chunk does."""

    kind: int
    body: bytes
    at: int


def records(stream: IO[bytes], path: Path) -> Iterator[Record | None]:
    """Schemas, channels and messages in the order of the file; chunks are opened. None where the file was cut off.

    Raises BagError for a file that is no bag, or is damaged.
    """
    stream.seek(0, 2)
    size = stream.tell()
    stream.seek(0)
    if stream.read(len(MAGIC)) != MAGIC:
        raise BagError(f"{path} is no MCAP file{': it is empty' if not size else ''}")
    while True:
        at = stream.tell()
        head = stream.read(_RECORD.size)
        if len(head) < _RECORD.size:
            yield None
            return
        kind, length = _RECORD.unpack(head)
        if kind == DATA_END:
            return
        if length > size - stream.tell():
            yield None
            return
        if kind not in WANTED:
            stream.seek(length, 1)
            continue
        if length > LARGEST:
            raise BagError(f"{path}: a record of {length} bytes at byte {at}; at most {LARGEST} are read")
        body = stream.read(length)
        try:
            yield from _inside(body, at) if kind == CHUNK else [Record(kind, body, at)]
        except (struct.error, ValueError) as error:
            raise BagError(f"{path} is damaged at byte {at}: {error or 'no such record'}") from None


def text(body: bytes, at: int) -> tuple[str, int]:
    """The text that begins at a byte, after its length, and where it ends. Raises ValueError."""
    raw, end = blob(body, at)
    return raw.decode(), end


def blob(body: bytes, at: int) -> tuple[bytes, int]:
    """The bytes that begin at a byte, after their length, and where they end. Raises ValueError."""
    if at + 4 > len(body):
        raise ValueError("it ends too early")
    end = at + 4 + int.from_bytes(body[at : at + 4], "little")
    if end > len(body):
        raise ValueError("it ends too early")
    return body[at + 4 : end], end


def _inside(chunk: bytes, at: int) -> Iterator[Record]:
    """The records in a chunk."""
    _, _, size, checksum = _CHUNK.unpack_from(chunk)
    compression, start = text(chunk, _CHUNK.size)
    if size > LARGEST:
        raise ValueError(f"a chunk of {size} bytes; at most {LARGEST} are read")
    data = _unpacked(memoryview(chunk)[start + 8 :], compression, size)
    if checksum and (_checksum(data) != checksum):
        raise ValueError("the checksum is wrong")
    offset = 0
    while offset < len(data):
        kind, length = _RECORD.unpack_from(data, offset)
        offset += _RECORD.size
        if length > len(data) - offset:
            raise ValueError("a record is longer than its chunk")
        if kind in (SCHEMA, CHANNEL, MESSAGE):
            yield Record(kind, data[offset : offset + length], at)
        offset += length


def _checksum(data: bytes) -> int:
    import zlib

    return zlib.crc32(data)


def _unpacked(packed: memoryview, compression: str, size: int) -> bytes:
    """The data of a chunk. Its own word for the size is the limit, so that a few bytes do not become all of memory."""
    if compression == "":
        data = bytes(packed)
    elif compression == "zstd":
        import zstandard

        try:
            with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(packed) as reader:
                data = reader.read(size + 1)
        except zstandard.ZstdError as error:
            raise ValueError(str(error)) from None
    elif compression == "lz4":
        import lz4.frame

        try:
            data = lz4.frame.LZ4FrameDecompressor().decompress(packed, size + 1)
        except RuntimeError as error:
            raise ValueError(str(error)) from None
    else:
        raise ValueError(f"compression {compression[:20]!r} is not understood; known: zstd, lz4")
    if len(data) != size:
        raise ValueError("a chunk has not the size it says")
    return data
