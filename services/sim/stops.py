"""The software stops in files, so that they outlast the sim: one that is started again has its robots stopped too."""

import os
import re
import stat
import zlib
from pathlib import Path
from urllib.parse import quote

from holozen.console import report
from holozen.suggest import cut

UNREADABLE = "this sim, which could not read who did"
MOST_BYTES = 1000


class StopFiles:
    """Who stopped which robot: in a `folder` each network (`where`) has a folder of its own, and there each robot that
    is stopped has a file, by whichever sim.

    It is written before a stop is confirmed, but not synced: it outlasts the sim, however that ends, and after a loss
    of power it may lack the last seconds.
    """

    def __init__(self, folder: Path, where: str) -> None:
        plain = re.sub(r"[^A-Za-z0-9.]+", "_", where)[:60]
        self._folder = folder / f"{plain}-{zlib.crc32(where.encode()):08x}"
        self._last: dict[str, str] = {}  # what the files of robots hold, where that is known
        self._is_reported = False

    def path(self, robot: str) -> Path:
        """The file of a robot; `robot` is empty for that at the root."""
        return self._folder / f"{quote(robot, safe='') or '@'}.stop"

    def read(self, robot: str) -> str:
        """Who stopped a robot; empty without a file. Whatever else is in its place stops it too."""
        path = self.path(robot)
        self._last.pop(robot, None)
        try:
            by = self._last[robot] = _setter_in(path)
            return by if by.isprintable() and len(by) < 100 else cut(by)
        except FileNotFoundError:
            self._last[robot] = ""
            return ""
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "it is damaged"
            report(f"sim: {path}: {why}, so {robot or 'the robot'} is stopped until `holozen release`")
            return UNREADABLE

    def write(self, robot: str, by: str) -> None:
        """Keep who stopped a robot; empty: no one. An error is reported once: the sim has the stops all the same."""
        if self._last.get(robot) == by:
            return
        path = self.path(robot)
        self._last.pop(robot, None)
        try:
            if by:
                _replace(path, by)
            else:
                path.unlink(missing_ok=True)
            self._last[robot], self._is_reported = by, False
        except OSError as error:
            if not self._is_reported:
                kept = "stops hold, but not beyond the end of this sim" if by else "the next sim has the robot stopped"
                report(f"sim: {path}: {error.strerror}: {kept}")
            self._is_reported = True

    def forget(self, robot: str) -> None:
        """Free the memory of a robot that is gone; its file stays."""
        self._last.pop(robot, None)


def _replace(path: Path, text: str) -> None:
    """Raises OSError."""
    new = path.with_suffix(".new")
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    new.unlink(missing_ok=True)
    with open(new, "xb", opener=lambda path, flags: os.open(path, flags, 0o600)) as file:
        file.write(text.encode(errors="replace"))
    new.replace(path)


def _setter_in(path: Path) -> str:
    """Raises OSError or ValueError."""
    with open(path, "rb", opener=lambda path, flags: os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError
        text = file.read(MOST_BYTES).decode()
    if not text:
        raise ValueError
    return text
