"""Which processes of this machine listen on a TCP port, from /proc, and whether an endpoint can be reached."""

import contextlib
import os
import socket
import threading
import time
from collections.abc import Iterable
from typing import NamedTuple

from holozen.console import printable
from holozen.transport.connection import address

PATIENCE = 0.4  # s to connect
HERE = ("127.0.0.1", "localhost", "::1", "0.0.0.0", "::")  # this machine


class Holder(NamedTuple):
    """A process that listens on a port. `pid` is 0 if it belongs to another user."""

    pid: int
    command: str = ""
    stopped: bool = False  # by Ctrl-Z or SIGSTOP

    def __str__(self) -> str:
        if not self.pid:
            return "a process of another user"
        return f"{self.command!r} (pid {self.pid}{', stopped as by Ctrl-Z' if self.stopped else ''})"

    @property
    def fix(self) -> str:
        """The fix if it does not answer."""
        if self.stopped:
            return f"continue it: kill -CONT {self.pid}"
        return f"end it: kill {self.pid}" if self.pid else "ask the other user to end it"


def holders(port: int, proc: str = "/proc") -> list[Holder]:
    """The processes that listen on a port of this machine, as far as /proc lists them."""
    sockets = set()
    for table in ("tcp", "tcp6"):
        with contextlib.suppress(OSError), open(f"{proc}/net/{table}") as file:
            rows = [line.split() for line in file.readlines()[1:]]
            sockets |= {f"socket:[{row[9]}]" for row in rows if row[3] == "0A" and row[1].endswith(f":{port:04X}")}
    found = {}
    for pid in (name for name in os.listdir(proc) if name.isdecimal() and sockets):
        with contextlib.suppress(OSError):
            for name in os.listdir(f"{proc}/{pid}/fd"):
                with contextlib.suppress(OSError):
                    if (target := os.readlink(f"{proc}/{pid}/fd/{name}")) in sockets:
                        found[target] = _holder(int(pid), proc)
    return sorted({found.get(each, Holder(0)) for each in sockets})


def _holder(pid: int, proc: str) -> Holder:
    with open(f"{proc}/{pid}/cmdline", "rb") as file, open(f"{proc}/{pid}/stat", "rb") as stat:
        program, *words = file.read(10_000).decode(errors="replace").split("\0")
        state = stat.read().rpartition(b") ")[2][:1]
    return Holder(pid, printable(" ".join([os.path.basename(program), *words]).strip())[:60], state in (b"T", b"t"))


class Attempts:
    """TCP connection attempts in parallel, each for at most `seconds`. Other protocols are skipped."""

    def __init__(self, endpoints: Iterable[str], seconds: float) -> None:
        self._seconds = seconds
        self.reasons: dict[str, str] = {}
        """Endpoint -> why the connection failed, empty if it succeeded; absent during the attempt."""
        self._threads = []
        for endpoint in endpoints:
            if place := address(endpoint):
                # In threads: resolving a name may take longer than the socket's timeout.
                self._threads.append(threading.Thread(target=self._try, args=(endpoint, place), daemon=True))
                self._threads[-1].start()

    def failed(self, endpoint: str) -> bool:
        """Whether a connection failed."""
        return bool(self.reasons.get(endpoint))

    def wait(self) -> dict[str, str]:
        """The reasons of all; waits at most `seconds`."""
        deadline = time.monotonic() + self._seconds
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        return dict(self.reasons)

    def _try(self, endpoint: str, place: tuple[str, int]) -> None:
        try:
            socket.create_connection(place, timeout=self._seconds).close()
            self.reasons[endpoint] = ""
        except (OSError, UnicodeError) as error:
            self.reasons[endpoint] = getattr(error, "strerror", None) or str(error)


def exposure(endpoints: Iterable[str]) -> str:
    """A warning about endpoints that other machines can reach, to follow the name of a node."""
    where = ", ".join(endpoints)
    risk = "anyone who can reach it can drive, stop and delete robots, and set parameters"
    return f"listens at {where}, open to the network: {risk}"


def is_open(endpoint: str) -> bool:
    """Whether other machines can reach an endpoint: it is neither on loopback nor a socket file."""
    protocol, _, place = endpoint.partition("#")[0].partition("?")[0].partition("/")
    if protocol in ("unixsock-stream", "unixpipe", "serial", "vsock"):
        return False
    host = place.rpartition(":")[0].strip("[]")
    try:
        found = {str(row[4][0]) for row in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError):
        return True
    return not all(one.startswith("127.") or one == "::1" for one in found)


def reached(endpoints: Iterable[str]) -> dict[str, str]:
    """Endpoint -> why a TCP connection to it fails, empty if it succeeds. Other protocols are skipped."""
    endpoints = [endpoint for endpoint in endpoints if address(endpoint)]
    return dict.fromkeys(endpoints, f"no answer within {PATIENCE:g} s") | Attempts(endpoints, PATIENCE).wait()


def unanswered(endpoints: Iterable[str], within: float) -> str:
    """Why no Zenoh node answers at `endpoints`, and what to do, in one line about the first with a known reason."""
    reasons = reached(endpoints)
    for endpoint, reason in reasons.items():
        place = address(endpoint)
        if place and place[0] in HERE and (here := holders(place[1])):
            return f"{endpoint} is held by {' and '.join(map(str, here))}, which does not answer; {here[0].fix}"
        if not reason:
            return f"{endpoint} accepts connections but does not answer as Zenoh does; check what listens there"
    where = ", ".join(endpoints)
    return f"no answer from {where} within {within:g} s; check address and network, and what listens there"
