"""Opens and summarizes bags: MCAP files, ROS 2's sqlite3 files, and the folders in which ROS 2
keeps either.
"""

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Self

from msgspec import Struct

from holozen.bags import BagError, Channel, Message
from holozen.suggest import shorten

if TYPE_CHECKING:
    from holozen.bags.mcap_file import McapFile
    from holozen.bags.sqlite_file import SqliteFile

FILES = (".mcap", ".db3")


class Bag:
    """A file to read, also by its name without .mcap, or a folder of ROS 2 with such files.

    Once its messages are read, `cut_off` is true if the end of a file is missing. While they are
    read, `numbered` is true if the numbers of the messages include lost ones.
    """

    def __init__(self, path: Path) -> None:
        path = recorded(path)
        self.path, self.cut_off, self.numbered = path, False, False
        self._files: list[McapFile | SqliteFile] = []
        try:
            for one in files_of(path):
                self._files.append(_opened(one))
        except BaseException:
            self.close()
            raise
        self.size = sum(file.size for file in self._files)  # bytes

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close its files."""
        for file in self._files:
            file.close()

    def messages(self) -> Iterator[Message]:
        """All messages, file by file, in the order of each. Raises BagError at damage."""
        for file in self._files:
            for message in file.messages():
                self.numbered = file.numbered
                yield message
            self.cut_off |= file.cut_off


def recorded(path: Path) -> Path:
    """`path`, or where that is nothing, the file that `record -o` writes under this name."""
    written = path.parent / f"{path.name}.mcap"
    return written if not path.exists() and written.exists() else path


def files_of(path: Path) -> list[Path]:
    """The files of a bag: `path` itself, or those in the folder `path`, by the numbers in their
    names.

    metadata.yaml lists them too, but is missing after a recorder was killed. Raises BagError for a
    folder without any.
    """
    if not path.is_dir():
        return [path]
    try:
        names = sorted(one.name for one in path.iterdir())
    except OSError as error:
        raise BagError(f"cannot read {path}: {error.strerror}") from None
    found = [path / name for name in names if name.endswith(FILES)]
    if packed := [name for name in names if name.endswith(tuple(f"{end}.zstd" for end in FILES))]:
        raise BagError(
            f"{path / packed[0]} is compressed as a whole; unpack it first: zstd -d --rm "
            f"{path}/*.zstd"
        )
    if not found:
        raise BagError(f"{path} is a folder without {' or '.join(FILES)} files")
    return sorted(found, key=lambda one: int((re.findall(r"\d+", one.stem[-19:]) or ["0"])[-1]))


def _opened(path: Path) -> "McapFile | SqliteFile":
    if path.suffix == ".db3":
        from holozen.bags.sqlite_file import SqliteFile

        return SqliteFile(path)
    from holozen.bags.mcap_file import McapFile

    return McapFile(path)


class Stream(Struct):
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
        self.count, self.bytes, self.last = (
            self.count + 1,
            self.bytes + len(message.payload),
            message.at,
        )

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


class Summary(Struct):
    """All channels of a bag. Times in ns."""

    path: str
    size: int
    streams: dict[Channel, Stream] = {}
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
        head = (
            f"{self.path}: {size}, {self.count} messages in {(self.end - self.start) / 1e9:.2f} s"
        )
        lines = [head + (f", from {_date(self.start)}" if self.count else "")]
        if self.cut_off:
            lines.append(
                "the recording was cut off: the end of the file is missing; everything listed "
                "here is usable"
            )
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
        words = [
            shorten(str(row["key"])),
            shorten(str(row["type"] or "?")),
            row["encoding"],
            row["messages"],
            row["missing"],
            rate,
        ]
        cells.append([*map(str, words), f"{row['longest_gap']} s"])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]


def _date(at: int) -> str:
    try:
        return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at / 1e9))
    except (OverflowError, ValueError, OSError):
        return f"{at / 1e9:.3f} s"
