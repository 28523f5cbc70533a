"""Writes bags, MCAP files or folders of ROS 2, that stay readable if the writer is killed or the
disk fills up.
"""

import contextlib
import errno
import json
import os
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer
from msgspec import Struct

from holozen.bags import ENCODING, BagError
from holozen.bags.formats import Format, offered_qos

# bytes of the disk kept free for the end of a file; a chunk and the summary take less
RESERVE = 8 << 20
CHUNK = 1 << 20  # bytes, before compression
CHANNELS = 65_535  # MCAP numbers them with two bytes
METADATA = "metadata.yaml"
VERSION = 5  # of metadata.yaml, that of Humble, which every later distribution reads


class BagWriter:
    """Writes the files of one recording: `NAME.mcap`, or `NAME_0.mcap`, `NAME_1.mcap`, ... each of
    about `limit` bytes.

    With a limit, or `numbered`, the first file has a number too. `profile` is MCAP's, "ros2" for
    ROS 2.

    Raises OSError if a file cannot be created, BagError if it cannot be continued; flushed data
    stays readable, unless the open file was deleted, which is then no longer among `files`.
    """

    def __init__(
        self, name: str, limit: int = 0, profile: str = "", numbered: bool = False
    ) -> None:
        self._name, self._limit, self._profile = name.removesuffix(".mcap"), limit, profile
        self._numbered = numbered or limit > 0
        self.files: list[Path] = []
        self.messages = 0
        self._before = 0  # bytes of the previous files
        self._open()

    @property
    def size(self) -> int:
        """Bytes in all files."""
        return self._before + self._file.size

    @property
    def full(self) -> str:
        """Why the disk accepts no more data, or empty. If set, close the writer."""
        return self._file.full

    def write(self, topic: str, form: Format, payload: bytes, at: int, missed: int = 0) -> bool:
        """Add a message that arrived at `at`, in ns since 1970; False if the file cannot have
        another channel.

        `missed` is the number of messages of this key lost since the previous one.
        """
        channel = self._channels.get((topic, form)) or self._add_channel(topic, form)
        if not channel:
            return False
        number = self._numbers[channel] = self._numbers.get(channel, -1) + 1 + missed
        sequence = number & 0xFFFFFFFF
        self._writer.add_message(
            channel, log_time=at, data=payload, publish_time=at, sequence=sequence
        )
        self.messages += 1
        if self._limit and self._file.size >= self._limit:
            self._finish()
            try:
                self._open()
            except OSError as error:
                raise BagError(error.strerror or str(error)) from None
        return True

    def flush(self) -> None:
        """Write the open chunk to the file, where it survives this process."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._check_kept()

    def close(self) -> None:
        """Finish the last file; a recording without messages leaves no file."""
        if not self.messages:
            self._file.remove()
            self.files.clear()
        else:
            self._finish()

    def abandon(self) -> None:
        """Close without the summary at the end, which did not fit. Readers do not require it."""
        self._file.close()

    def _open(self) -> None:
        number = f"_{len(self.files)}" if self._numbered else ""
        path = Path(f"{self._name}{number}.mcap")
        self._file = SafeFile(path)
        self.files.append(path)
        self._writer = Writer(self._file, chunk_size=CHUNK, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._channels: dict[tuple[str, Format], int] = {}
        self._schemas: dict[str, int] = {}
        self._numbers: dict[int, int] = {}
        try:
            self._writer.start(self._profile, "holozen")
        except BagError:
            self._file.close()
            raise

    def _check_kept(self) -> None:
        """Raise BagError if the open file was deleted."""
        if self._file.deleted and self._file.path in self.files:
            self.files.remove(self._file.path)
            raise BagError(f"{self._file.path} was deleted during the recording")

    def _finish(self) -> None:
        self._check_kept()
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()
        self._before += self._file.size
        self._file.size = 0

    def _add_channel(self, topic: str, form: Format) -> int:
        if len(self._channels) == CHANNELS:
            return 0
        schema = 0
        if form.schema_encoding:
            key = f"{form.schema} {form.schema_encoding}"
            if key not in self._schemas:
                self._schemas[key] = self._writer.register_schema(
                    form.schema, form.schema_encoding, form.schema_data
                )
            schema = self._schemas[key]
        metadata = {ENCODING: form.zenoh_encoding} | ({"type": form.schema} if form.schema else {})
        if self._profile == "ros2":
            metadata["offered_qos_profiles"] = offered_qos(topic)
        channel = self._writer.register_channel(topic, form.encoding, schema, metadata)
        self._channels[topic, form] = channel
        return channel


class Span(Struct):
    """How many messages, and the times of the first and the last, in ns."""

    count: int = 0
    first: int = 0
    last: int = 0

    def add(self, at: int) -> None:
        """Add a message."""
        self.first = min(self.first, at) if self.count else at
        self.last = max(self.last, at)
        self.count += 1

    def figures(self) -> dict[str, Any]:
        """As metadata.yaml has them."""
        return {
            "starting_time": {"nanoseconds_since_epoch": self.first},
            "duration": {"nanoseconds": self.last - self.first},
            "message_count": self.count,
        }


class RosBagWriter(BagWriter):
    """Writes a new folder as ROS 2 does, with `NAME_0.mcap`, `NAME_1.mcap`, ... and with
    metadata.yaml about them.

    Raises OSError if the folder or a file cannot be created, BagError if it cannot be continued.
    After a killed process metadata.yaml is missing; `ros2 bag reindex` makes it.
    """

    def __init__(self, name: str, limit: int = 0) -> None:
        self._folder = Path(name)
        self._spans: dict[str, Span] = {}  # by file name
        self._whole = Span()
        self._counts: Counter[tuple[str, str]] = Counter()  # of the messages, by topic and type
        self._folder.mkdir()
        try:
            super().__init__(str(self._folder / self._folder.name), limit, "ros2", numbered=True)
        except OSError:
            self._folder.rmdir()
            raise

    def write(self, topic: str, form: Format, payload: bytes, at: int, missed: int = 0) -> bool:
        """Add a message, as BagWriter does."""
        file = self.files[-1].name
        written = super().write(topic, form, payload, at, missed)
        if written:
            for span in (self._spans.setdefault(file, Span()), self._whole):
                span.add(at)
            self._counts[topic, form.schema] += 1
        return written

    def close(self) -> None:
        """Finish the last file and write metadata.yaml; a recording without messages leaves no
        folder.
        """
        super().close()
        if self.messages:
            self._describe()
        elif self._folder.exists():
            self._folder.rmdir()

    def abandon(self) -> None:
        """Close without the summary at the end of the last file, which did not fit."""
        super().abandon()
        # else it was deleted: `ros2 bag reindex` describes the rest
        if self._file.path in self.files:
            with contextlib.suppress(OSError):
                self._describe()

    def _describe(self) -> None:
        topics = [
            {
                "topic_metadata": {
                    "name": topic,
                    "type": kind,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": offered_qos(topic),
                },
                "message_count": count,
            }
            for (topic, kind), count in self._counts.items()
        ]
        information = {
            "version": VERSION,
            "storage_identifier": "mcap",
            **self._whole.figures(),
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": list(self._spans),
            "files": [{"path": name, **span.figures()} for name, span in self._spans.items()],
        }
        # which every reader of YAML reads
        text = json.dumps({"rosbag2_bagfile_information": information}, indent=1)
        (self._folder / METADATA).write_text(f"{text}\n", encoding="utf-8")


class SafeFile:
    """A new file. Writes are atomic, and disk space is reserved for its end.

    Raises OSError if it cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.size = path, 0  # bytes
        self.full = ""  # why the disk accepts no more data, or empty
        self._number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        # Unnamed, so that it disappears with the process.
        self._spare = tempfile.TemporaryFile(dir=path.parent)  # noqa: SIM115
        try:
            os.posix_fallocate(self._spare.fileno(), 0, RESERVE)
        except OSError as error:
            if error.errno == errno.ENOSPC:
                self.remove()
                raise OSError(
                    error.errno, f"fewer than {RESERVE >> 20} MB of the disk are free", str(path)
                ) from None
            # Otherwise file sizes are limited, and there is no reserve.

    @property
    def deleted(self) -> bool:
        """Whether it has no name any more: what is written disappears."""
        return self._number >= 0 and os.fstat(self._number).st_nlink == 0

    def write(self, data: bytes) -> None:
        """Append `data`, on a full disk into the reserved space. Raises BagError if that is full
        too.
        """
        try:
            self._append(data)
        except OSError as error:
            if self.full:
                raise self._undone(error) from None
            self.full = error.strerror or str(error)
            self._spare.close()
            try:
                self._append(data)
            except OSError as again:
                raise self._undone(again) from None
        self.size += len(data)

    def tell(self) -> int:
        """The position of the next byte."""
        return self.size

    def flush(self) -> None:
        """Nothing to do: writes are unbuffered, and survive a killed process."""

    def close(self) -> None:
        """Close it, and free the reserved space."""
        self._spare.close()
        number, self._number = self._number, -1
        if number >= 0:
            with contextlib.suppress(OSError):
                os.close(number)

    def remove(self) -> None:
        """Close it and delete it."""
        self.close()
        self.path.unlink(missing_ok=True)

    def _undone(self, error: OSError) -> BagError:
        """Remove a partial write."""
        os.ftruncate(self._number, self.size)
        return BagError(error.strerror or str(error))

    def _append(self, data: bytes) -> None:
        view, at = memoryview(data), self.size
        while view:
            done = os.pwrite(self._number, view, at)
            view, at = view[done:], at + done
