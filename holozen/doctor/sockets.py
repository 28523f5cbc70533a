"""Who listens on a TCP port of this machine, as /proc tells."""

import contextlib
import os
import socket
import threading
from collections.abc import Iterable
from typing import NamedTuple

from holozen.tell import printable

LISTENS = "0A"  # the state in /proc/net/tcp
LONGEST = 60  # characters of a command
PATIENCE = 0.4  # s to connect


class Holder(NamedTuple):
    """A process that listens. `pid` is 0 where it is another user's and may not be looked at."""

    pid: int
    command: str
    uid: int
    asleep: bool = False  # by SIGSTOP, as of Ctrl-Z

    def __str__(self) -> str:
        if not self.pid:
            return f"a process of user {self.uid}, which you may not look at"
        return f"{self.command!r} (pid {self.pid}{', asleep as after Ctrl-Z' if self.asleep else ''})"

    @property
    def mend(self) -> str:
        """How to get past one that does not answer."""
        if self.asleep:
            return f"wake it: kill -CONT {self.pid}"
        return f"end it: kill {self.pid}" if self.pid else f"ask user {self.uid} to end it"


def holders(port: int, proc: str = "/proc") -> list[Holder]:
    """Those who listen on `port`, as far as this user may know."""
    inodes = _listening(port, proc)
    found = {inode: pid for pid in _pids(proc) for inode in _inodes(pid, proc) if inode in inodes} if inodes else {}
    rows = {_holder(found.get(inode, 0), uid, proc) for inode, uid in inodes.items()}
    return sorted(rows)


def _listening(port: int, proc: str) -> dict[str, int]:
    """Inode -> user of the sockets that listen on `port`."""
    rows: dict[str, int] = {}
    for table in ("tcp", "tcp6"):
        with contextlib.suppress(OSError), open(f"{proc}/net/{table}") as file:
            for words in (line.split() for line in file.readlines()[1:]):
                if words[3] == LISTENS and int(words[1].rpartition(":")[2], 16) == port:
                    rows[words[9]] = int(words[7])
    return rows


def _pids(proc: str) -> list[int]:
    return [int(name) for name in os.listdir(proc) if name.isdecimal()]


def _inodes(pid: int, proc: str) -> list[str]:
    """The sockets that a process has open; none if it is gone, or another user's."""
    found = []
    with contextlib.suppress(OSError):
        for name in os.listdir(f"{proc}/{pid}/fd"):
            with contextlib.suppress(OSError):
                target = os.readlink(f"{proc}/{pid}/fd/{name}")
                if target.startswith("socket:["):
                    found.append(target[8:-1])
    return found


def _holder(pid: int, uid: int, proc: str) -> Holder:
    command, asleep = "", False
    with contextlib.suppress(OSError):
        if pid:
            with open(f"{proc}/{pid}/cmdline", "rb") as file:
                words = file.read(10_000).decode(errors="replace").split("\0")
            command = printable(" ".join([os.path.basename(words[0]), *words[1:]]).strip())[:LONGEST]
            with open(f"{proc}/{pid}/stat", "rb") as file:
                asleep = file.read().rpartition(b") ")[2][:1] in (b"T", b"t")
    return Holder(pid, command, uid, asleep)


def reached(endpoints: Iterable[str]) -> dict[str, str]:
    """Endpoint -> why a TCP connection to it fails, empty if it does not. Others than tcp are left out."""
    reasons: dict[str, str] = {}
    threads = []
    for endpoint in endpoints:
        if place := address(endpoint):
            reasons[endpoint] = f"no answer within {PATIENCE:g} s"
            # In threads: looking up a name may take longer than any socket's timeout.
            threads.append(threading.Thread(target=_reach, args=(endpoint, place, reasons), daemon=True))
            threads[-1].start()
    for thread in threads:
        thread.join(PATIENCE)
    return dict(reasons)


def address(endpoint: str) -> tuple[str, int] | None:
    """Host and port of a TCP endpoint such as tcp/127.0.0.1:7447; None for any other."""
    kind, _, place = endpoint.partition("#")[0].partition("?")[0].partition("/")
    host, _, port = place.rpartition(":")
    return (host.strip("[]"), int(port)) if kind in ("tcp", "tls") and port.isdecimal() and int(port) < 65536 else None


def _reach(endpoint: str, place: tuple[str, int], reasons: dict[str, str]) -> None:
    try:
        socket.create_connection(place, timeout=PATIENCE).close()
        reasons[endpoint] = ""
    except (OSError, UnicodeError) as error:
        reasons[endpoint] = getattr(error, "strerror", None) or str(error)
