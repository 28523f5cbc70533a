"""Software stops in files, so that they outlast the process that serves a robot, a sim or a real base: the next one has
the same robots stopped.
"""

import os
import re
import stat
import zlib
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import quote

from holozen.console import report
from holozen.suggest import cut

UNREADABLE = "the robot's own process, which could not read who did"
MAX_BYTES = 1000


def default_folder() -> Path | None:
    """The folder where no flag gives one: HOLOZEN_STATE, else the user's own; None without a home."""
    if given := os.environ.get("HOLOZEN_STATE"):
        return Path(given)
    base = os.environ.get("XDG_STATE_HOME", "")
    base = base if os.path.isabs(base) else os.path.expanduser("~/.local/state")
    return Path(base, "holozen") if os.path.isabs(base) else None


class StopFiles:
    """Who stopped which robot. In `folder`, each network has a folder of its own, with a file for each stopped robot,
    whichever process serves it. A process that is in several `networks` writes to the folders of all, and a robot is
    stopped if any of them has its file. Reports begin with `reporter`.

    A file is written before the stop is confirmed, but not synced: it outlasts the process, however that ends, but a
    loss of power may undo the last seconds.
    """

    def __init__(self, folder: Path, networks: Iterable[str], reporter: str = "sim") -> None:
        self._all = folder
        self._folders = [folder / _name(network) for network in networks]
        self._last: dict[str, str] = {}  # robot -> contents of all its files, if known
        self._is_reported, self._reporter = False, reporter

    def paths(self, robot: str) -> list[Path]:
        """The files of a robot, one for each network; `robot` is empty for the one at the root."""
        return [folder / _file(robot) for folder in self._folders]

    def read(self, robot: str) -> str:
        """Who stopped a robot; empty without a file. A file that cannot be read stops it too, and is reported; so is
        one of another network, which does not stop it.
        """
        self._last.pop(robot, None)
        found = {self._read(path, robot) for path in self.paths(robot)}
        if found == {""}:
            for path in self._all.glob(f"*/{_file(robot)}"):
                what = f"{robot or 'the robot'} is stopped in another network, and not in this one"
                report(f"{self._reporter}: {path}: {what}")
        by = min(found - {""}, key=lambda by: (by == UNREADABLE, by), default="")
        if found == {by} and by != UNREADABLE:
            self._last[robot] = by
        return by if by.isprintable() and len(by) < 100 else cut(by)

    def _read(self, path: Path, robot: str) -> str:
        try:
            return _setter_in(path)
        except FileNotFoundError:
            return ""
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "it is damaged"
            report(f"{self._reporter}: {path}: {why}, so {robot or 'the robot'} is stopped until `holozen release`")
            return UNREADABLE

    def write(self, robot: str, by: str) -> None:
        """Record who stopped a robot; empty: no one. An error is only reported, once: the stop holds all the same."""
        if self._last.get(robot) == by:
            return
        self._last.pop(robot, None)
        written = [self._write(path, by) for path in self.paths(robot)]  # also after one that failed
        if all(written):
            self._last[robot], self._is_reported = by, False

    def _write(self, path: Path, by: str) -> bool:
        try:
            if by:
                _replace(path, by)
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            if not self._is_reported:
                lost, left = "stops hold, but not beyond the end of this process", "the next one has the robot stopped"
                kept = lost if by else left
                report(f"{self._reporter}: {path}: {error.strerror}: {kept}")
            self._is_reported = True
            return False
        return True

    def forget(self, robot: str) -> None:
        """Forget a robot that is gone; its file stays."""
        self._last.pop(robot, None)


def _name(network: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9.]+", "_", network)[:60]
    return f"{plain}-{zlib.crc32(network.encode()):08x}"


def _file(robot: str) -> str:
    return f"{quote(robot, safe='') or '@'}.stop"


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
        text = file.read(MAX_BYTES).decode()
    if not text:
        raise ValueError
    return text
