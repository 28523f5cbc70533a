"""Bags, written so that they can be read whatever happens to the writer."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from mcap.writer import CompressionType, Writer

from holozen.bag import ENCODING
from holozen.bag.errors import BagError
from holozen.bag.file import SafeFile
from holozen.bag.forms import Form

CHUNK = 1 << 20  # bytes, before compression
CHANNELS = 65_535  # MCAP numbers them with two bytes


class BagWriter:
    """Writes the files of one recording: `NAME.mcap`, or `NAME_0.mcap`, `NAME_1.mcap`, ... each of about `limit` bytes.

    Raises OSError when a file cannot be made, BagError when it cannot be written on; what was flushed before stays
    readable.
    """

    def __init__(self, name: str, limit: int = 0, profile: str = "") -> None:
        self._name, self._limit, self._profile = name.removesuffix(".mcap"), limit, profile
        self.files: list[Path] = []
        self.messages = 0
        self._before = 0  # bytes of the files before
        self._open()

    @property
    def size(self) -> int:
        """Bytes in all files."""
        return self._before + self._file.size

    @property
    def full(self) -> str:
        """Why the disk takes no more, once that is so: end then."""
        return self._file.full

    def write(self, topic: str, form: Form, payload: bytes, at: int, number: int = -1) -> bool:
        """Add a message that came at `at`, in ns since 1970; False if the file has no room for one more channel.

        `number` is its publisher's count; without one it is counted here.
        """
        channel = self._channels.get((topic, form)) or self._add_channel(topic, form)
        if not channel:
            return False
        count = self._counts[channel] = self._counts.get(channel, -1) + 1
        sequence = (count if number < 0 else number) & 0xFFFFFFFF
        self._writer.add_message(channel, log_time=at, data=payload, publish_time=at, sequence=sequence)
        self.messages += 1
        if self._limit and self._file.size >= self._limit:
            self._finish()
            self._open_next()
        return True

    def flush(self) -> None:
        """Put what waits into the file: from then on it survives this process."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """End the last file properly; a recording without messages leaves none."""
        if not self.messages:
            self._file.remove()
            self.files.clear()
        else:
            self._finish()

    def abandon(self) -> None:
        """Close without the summary at the end, which did not fit. Readers find the messages without it."""
        self._file.close()

    def _open_next(self) -> None:
        try:
            self._open()
        except OSError as error:
            raise BagError(error.strerror or str(error)) from None

    def _open(self) -> None:
        number = f"_{len(self.files)}" if self._limit else ""
        path = Path(f"{self._name}{number}.mcap")
        self._file = SafeFile(path)
        self.files.append(path)
        self._writer = Writer(self._file, chunk_size=CHUNK, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._channels: dict[tuple[str, Form], int] = {}
        self._schemas: dict[str, int] = {}
        self._counts: dict[int, int] = {}
        with self._or_close():
            self._writer.start(self._profile, "holozen")

    def _finish(self) -> None:
        with self._or_close():
            self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()
        self._before += self._file.size
        self._file.size = 0

    @contextlib.contextmanager
    def _or_close(self) -> Iterator[None]:
        try:
            yield
        except BagError:
            self._file.close()
            raise

    def _add_channel(self, topic: str, form: Form) -> int:
        if len(self._channels) == CHANNELS:
            return 0
        schema = 0
        if form.schema_encoding:
            key = f"{form.schema} {form.schema_encoding}"
            if key not in self._schemas:
                self._schemas[key] = self._writer.register_schema(form.schema, form.schema_encoding, form.schema_data)
            schema = self._schemas[key]
        metadata = {ENCODING: form.zenoh_encoding} | ({"type": form.schema} if form.schema else {})
        channel = self._writer.register_channel(topic, form.encoding, schema, metadata)
        self._channels[topic, form] = channel
        return channel
