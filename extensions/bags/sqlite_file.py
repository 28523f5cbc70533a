"""Reads the sqlite3 files of ROS 2's bags (rosbag2_storage_sqlite3), which may be damaged or
malicious.
"""

import sqlite3
from collections.abc import Iterator
from pathlib import Path

from holozen.bags import BagError, Channel, Message
from holozen.messages import encoding_of

LARGEST = 256 << 20  # bytes of a message
TABLES = ("topics", "messages")
ZSTD = b"\x28\xb5\x2f\xfd"  # begins what is compressed; CDR begins with a zero


class SqliteFile:
    """A .db3 file to read. Its messages have no numbers, so losses in it are not known."""

    cut_off = numbered = False

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.size = path.stat().st_size  # bytes
            self._database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
        except OSError as error:
            raise BagError(f"cannot read {path}: {error.strerror}") from None
        except sqlite3.Error as error:
            raise BagError(f"cannot read {path}: {error}") from None
        self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST)
        self._database.text_factory = bytes  # decoded below, with an error that names the file

    def close(self) -> None:
        """Close it."""
        self._database.close()

    def messages(self) -> Iterator[Message]:
        """All messages, in the order of their times. Raises BagError at damage."""
        try:
            self._check_tables()
            rows = self._database.execute("SELECT id, name, type, serialization_format FROM topics")
            channels = {number: self._channel(*words) for number, *words in rows}
            for number, at, payload in self._database.execute(
                "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"
            ):
                if (
                    number not in channels
                    or not isinstance(payload, bytes)
                    or not (isinstance(at, int) and at >= 0)
                ):
                    raise BagError(
                        f"{self.path} is damaged: a message without a topic, a time or its bytes"
                    )
                if payload.startswith(ZSTD):
                    raise BagError(
                        f"the messages of {self.path} are compressed one by one; `ros2 bag "
                        "convert` unpacks"
                    )
                yield Message(channels[number], at, payload)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise BagError(f"{self.path} is not a bag of ROS 2, or damaged: {error}") from None

    def _check_tables(self) -> None:
        """Refuse views: they may compute without end."""
        found = self._database.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")
        names = {name for (name,) in found}
        if missing := [name for name in TABLES if name.encode() not in names]:
            raise BagError(f"{self.path} is not a bag of ROS 2: it has no table {missing[0]!r}")

    def _channel(self, *words: object) -> Channel:
        if not all(isinstance(word, bytes) for word in words):
            raise BagError(f"{self.path} is damaged: a topic without a name, a type or a format")
        name, kind, form = (word.decode() for word in words if isinstance(word, bytes))
        return Channel(
            name.removeprefix("/"), encoding_of("cdr", kind) if form == "cdr" else form, form, kind
        )
