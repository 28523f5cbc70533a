"""The software stops in a file, so that they outlast the sim: one that is started again has its robots stopped too."""

import json
import os
import re
import stat
import zlib
from collections.abc import Mapping
from pathlib import Path

from holozen.console import report
from holozen.suggest import cut

ALL = "*"  # in the place of a robot's prefix: every robot that is not known
UNREADABLE = "this sim, which could not read who was"
MOST_BYTES = 1_000_000


class StopFile:
    """Who stopped which robot of one sim. In a `folder` each network (`where`) and each node of it has its own file.

    It is written before a stop is confirmed, but not synced: it outlasts the sim, however that ends, and after a loss
    of power it may lack the last seconds.
    """

    def __init__(self, folder: Path, where: str, node: str) -> None:
        self.path = folder / f"{_plain(where)}-{zlib.crc32(where.encode()):08x}-{_plain(node)}.json"
        self._last: Mapping[str, str] | None = {}  # what it holds; None after an error
        self._is_reported = False

    def read(self) -> dict[str, str]:
        """The prefix of each stopped robot -> who stopped it; empty without a file, ALL for one that cannot be read."""
        try:
            self._last = found = _stops_in(self.path)
            return dict(found)
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, RecursionError) as error:
            why = error.strerror if isinstance(error, OSError) else "it is damaged"
            report(f"sim: {self.path}: {why}, so every robot is stopped until `holozen release`")
            self._last = None
            return {ALL: UNREADABLE}

    def write(self, stops: Mapping[str, str]) -> None:
        """Replace what it holds. An error is reported once: the sim has the stops all the same."""
        if stops == self._last:
            return
        new = self.path.with_suffix(".new")
        try:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            new.unlink(missing_ok=True)
            with open(new, "xb", opener=lambda path, flags: os.open(path, flags, 0o600)) as file:
                file.write(json.dumps(stops).encode())
            new.replace(self.path)
            self._last, self._is_reported = dict(stops), False
        except OSError as error:
            self._last = None
            if not self._is_reported:
                report(f"sim: {self.path}: {error.strerror}: stops hold, but not beyond the end of this sim")
            self._is_reported = True


def _stops_in(path: Path) -> dict[str, str]:
    """Raises OSError, ValueError or RecursionError."""
    with open(path, "rb", opener=lambda path, flags: os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError
        data = json.loads(file.read(MOST_BYTES))
    if not isinstance(data, dict) or not all(isinstance(by, str) and by for by in data.values()):
        raise ValueError
    return {prefix: by if by.isprintable() and len(by) < 100 else cut(by) for prefix, by in data.items()}


def _plain(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "_", text)[:60]
