"""Software stops in files, so that they outlast the process that serves a robot, a sim or a real
base: the next one has the same robots stopped.
"""

import os
import re
import stat
import threading
import time
import zlib
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import quote

from holozen.console import report
from holozen.suggest import cut

UNREADABLE = "the robot's own process, which could not read who did"
MAX_BYTES = 1000
HANGS = 0.25  # s after which a disk counts as hung; meanwhile a base goes on at its last velocity
HUNG = "the disk does not answer: the stop holds, and its file is written once it does"
HUNG_AT_RELEASE = (
    "the disk does not answer: until its file is removed, a new process has the robot stopped"
)


def default_folder() -> Path | None:
    """The folder where no flag gives one: HOLOZEN_STATE, else the user's own; None without a
    home.
    """
    if given := os.environ.get("HOLOZEN_STATE"):
        return Path(given)
    base = os.environ.get("XDG_STATE_HOME", "")
    base = base if os.path.isabs(base) else os.path.expanduser("~/.local/state")
    return Path(base, "holozen") if os.path.isabs(base) else None


class StopFiles:
    """Who stopped which robot. In `folder`, each network has a folder of its own, with a file for
    each stopped robot, whichever process serves it. A process that is in several `networks` writes
    to the folders of all, and a robot is stopped if any of them has its file. Reports begin with
    `reporter`.

    A file is written before the stop is confirmed, but not synced: it outlasts the process, however
    that ends, but a loss of power may undo the last seconds. A disk that hangs holds up no robot:
    another thread writes, and is waited for no longer than HANGS.
    """

    def __init__(self, folder: Path, networks: Iterable[str], reporter: str = "sim") -> None:
        self._all = folder
        self._folders = [folder / _name(network) for network in networks]
        # robot -> contents of all its files, if known; None: it has no file
        self._last: dict[str, str | None] = {}
        self._reporter = reporter
        self._reported = set[
            tuple[str, bool]
        ]()  # robots whose stop, or release, could not be written
        self._lock = threading.Lock()  # of these three
        self._wanted: dict[str, str | None] = {}  # robot -> what is to be written
        self._failed: dict[str, str] = {}  # robot -> why that failed, or ""
        self._writer: threading.Thread | None = None
        self._began = 0.0  # s, monotonic: when it began with a robot

    def paths(self, robot: str) -> list[Path]:
        """The files of a robot, one for each network; `robot` is empty for the one at the root."""
        return [folder / _file(robot) for folder in self._folders]

    def read(self, robot: str) -> str | None:
        """Who stopped a robot; None without a file. A file that cannot be read stops it too, and
        is reported; so is one of another network, which does not stop it.
        """
        self._last.pop(robot, None)
        found = {self._read(path, robot) for path in self.paths(robot)}
        if found == {None}:
            for path in self._all.glob(f"*/{_file(robot)}"):
                what = f"{robot or 'the robot'} is stopped in another network, and not in this one"
                report(f"{self._reporter}: {path}: {what}")
        setters = [by for by in found if by is not None]
        by = min(setters, key=lambda by: (by == UNREADABLE, by), default=None)
        if found == {by} and by != UNREADABLE:
            self._last[robot] = by
        return by if by is None or (by.isprintable() and len(by) < 100) else cut(by)

    def _read(self, path: Path, robot: str) -> str | None:
        try:
            return _setter_in(path)
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "it is damaged"
            report(
                f"{self._reporter}: {path}: {why}, so {robot or 'the robot'} is stopped until "
                "`holozen release`"
            )
            return UNREADABLE

    def write(self, robot: str, by: str | None) -> str:
        """Record who stopped a robot; None: no one. Returns why that failed and what follows, or
        "". It is reported too, once: the stop holds all the same.
        """
        if by is None and self._writer is None and self._is_kept(robot, by):
            return ""  # at each spawn of a robot that is not stopped, without the cost of a thread
        with self._lock:
            self._wanted[robot] = by
            if (writer := self._writer) is None:
                self._began = time.monotonic()
                writer = self._writer = threading.Thread(target=self._write_wanted, daemon=True)
                writer.start()
        writer.join(max(0.0, self._began + HANGS - time.monotonic()))
        if not writer.is_alive():
            return self._failed.pop(robot, "")
        reason = f"{self.paths(robot)[0]}: {HUNG_AT_RELEASE if by is None else HUNG}"
        self._report(robot, by, reason)
        return reason

    def _write_wanted(self) -> None:
        while True:
            with self._lock:
                if not self._wanted:
                    self._writer = None
                    return
                robot, by = self._wanted.popitem()
                self._began = time.monotonic()
            failed = self._write_files(robot, by)
            with self._lock:
                self._failed[robot] = failed

    def _write_files(self, robot: str, by: str | None) -> str:
        """Write all files of a robot. Returns why that failed, or ""."""
        if self._is_kept(robot, by):
            return ""
        self._last.pop(robot, None)
        # all are tried
        failures = [*filter(None, [_written(path, by) for path in self.paths(robot)])]
        if not failures:
            self._last[robot] = by
            self._reported -= {(robot, True), (robot, False)}
            return ""
        lost, left = (
            "stops hold, but not beyond the end of this process",
            "the next one has the robot stopped",
        )
        reason = f"{failures[0]}: {left if by is None else lost}"
        self._report(robot, by, reason)
        return reason

    def _is_kept(self, robot: str, by: str | None) -> bool:
        if robot not in self._last or self._last[robot] != by:
            return False
        return all(os.path.exists(path) == (by is not None) for path in self.paths(robot))

    def _report(self, robot: str, by: str | None, reason: str) -> None:
        what = (robot, by is not None)
        if what not in self._reported:
            self._reported.add(what)
            report(f"{self._reporter}: {reason}")

    def forget(self, robot: str) -> None:
        """Forget a robot that is gone; its file stays."""
        self._last.pop(robot, None)
        self._reported -= {(robot, True), (robot, False)}


def _name(network: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9.]+", "_", network)[:60]
    return f"{plain}-{zlib.crc32(network.encode()):08x}"


def _file(robot: str) -> str:
    return f"{quote(robot, safe='') or '@'}.stop"


def _written(path: Path, by: str | None) -> str:
    """Write a file, or without `by` remove it. Returns why that failed, or ""."""
    try:
        if by is None:
            path.unlink(missing_ok=True)
        else:
            _replace(path, by)
    except OSError as error:
        return f"{path}: {error.strerror}"
    return ""


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
    with open(
        path, "rb", opener=lambda path, flags: os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)
    ) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError
        text = file.read(MAX_BYTES).decode()
    if not text:
        raise ValueError
    return text
