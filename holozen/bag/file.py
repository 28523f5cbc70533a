"""A file that can be written to its end, also on a full disk: room is kept aside for that."""

import contextlib
import errno
import os
import tempfile
from pathlib import Path

from holozen.bag.errors import BagError

ROOM = 8 << 20  # bytes kept aside; a chunk and the summary at the end of a bag take less


class SafeFile:
    """A new file. What `write` gets is either in it whole, or not at all. Raises OSError if it cannot be made."""

    def __init__(self, path: Path, room: int = ROOM) -> None:
        self.path, self.size = path, 0  # bytes
        self.full = ""  # why there is no more room, once that is so
        self._number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        # It has no name, and ends with the process.
        self._spare = tempfile.TemporaryFile(dir=path.parent)  # noqa: SIM115
        try:
            os.posix_fallocate(self._spare.fileno(), 0, room)
        except OSError as error:
            if error.errno == errno.ENOSPC:
                self.remove()
                raise
            # A limit on the size of files: it does without.

    def write(self, data: bytes) -> None:
        """Append `data`. On a full disk the room that was kept aside is used. Raises BagError when that is full too."""
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
        """Where the next byte goes."""
        return self.size

    def flush(self) -> None:
        """Nothing waits here; a killed process loses nothing of what was written."""

    def close(self) -> None:
        """Close it, and give the room back."""
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
        """Take back what was written in part."""
        os.ftruncate(self._number, self.size)
        return BagError(error.strerror or str(error))

    def _append(self, data: bytes) -> None:
        view, at = memoryview(data), self.size
        while view:
            done = os.pwrite(self._number, view, at)
            view, at = view[done:], at + done
