"""Which processes of this machine listen at an endpoint or are in a group, from /proc; whether one
can be reached.
"""

import contextlib
import os
import pwd
import socket
import ssl
import threading
import time
from collections.abc import Iterable
from typing import NamedTuple

from holozen.console import printable
from holozen.suggest import shorten
from holozen.transport.connection import HERE, address, socket_path
from holozen.transport.loopback import sockets as group_sockets

MAX_COMMAND_LINE = 60  # characters of a command line
PATIENCE = 0.4  # s to connect
REFUSED = 1.0  # s for a router to refuse a certificate
ACCEPTS = 0x10000  # __SO_ACCEPTCON, the kernel's flag of a socket that listens


class Holder(NamedTuple):
    """A process that listens at an endpoint. `pid` is 0 if it belongs to another user."""

    pid: int
    command: str = ""
    stopped: bool = False  # by Ctrl-Z or SIGSTOP

    def __str__(self) -> str:
        if not self.pid:
            return "a process of another user"
        return (
            f"{self.command!r} (pid {self.pid}{', stopped as by Ctrl-Z' if self.stopped else ''})"
        )

    @property
    def fix(self) -> str:
        """The fix if it does not answer."""
        if self.stopped:
            return f"continue it: kill -CONT {self.pid}"
        if not self.pid:
            return "ask the other user to look at it, or choose another --domain"
        return "it hangs, or others keep it busy: end it in its terminal once what it drives stands"


def holders(endpoint: str, proc: str = "/proc") -> list[Holder]:
    """The processes that listen at an endpoint of this machine, as far as /proc lists them."""
    return _owners(_sockets(endpoint, proc), proc)


def members(port: int) -> list[Holder]:
    """The processes in a multicast group on loopback, as far as /proc lists them."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return _owners(dict(group_sockets(port)), "/proc")
    return []


def _owners(sockets: dict[str, int], proc: str) -> list[Holder]:
    found = {}
    for pid in filter(str.isdecimal, os.listdir(proc) if sockets else ()):
        with contextlib.suppress(OSError):
            for name in os.listdir(f"{proc}/{pid}/fd"):
                with contextlib.suppress(OSError):
                    if (target := os.readlink(f"{proc}/{pid}/fd/{name}")) in sockets:
                        found[target] = _holder(int(pid), proc)
    return sorted({found.get(each, Holder(0)) for each in sockets})


def shared(port: int) -> str:
    """A warning, to follow a node's name, that another user's process is in a group; else empty."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        for number in {number for _, number in group_sockets(port)} - {0, os.geteuid()}:
            user = str(number)
            with contextlib.suppress(KeyError):
                user = pwd.getpwuid(number).pw_name
            apart = "--domain N (or HOLOZEN_DOMAIN) or --private keeps you apart"
            return (
                f"shares loopback with user {user}, so either can drive the other's robots; {apart}"
            )
    return ""


def _sockets(endpoint: str, proc: str) -> dict[str, int]:
    """The sockets that listen at an endpoint of this machine, as /proc/PID/fd names them, with
    their users' ids (-1 if unknown).
    """
    place, path = address(endpoint), socket_path(endpoint)
    if path:  # Num RefCount Protocol Flags Type St Inode Path
        rows = _rows(f"{proc}/net/unix")
        return {
            f"socket:[{row[6]}]": -1
            for row in rows
            if row[7:] == [path] and int(row[3], 16) & ACCEPTS
        }
    if not place or place[0] not in HERE:
        return {}
    rows = [*_rows(f"{proc}/net/tcp"), *_rows(f"{proc}/net/tcp6")]
    return {
        f"socket:[{row[9]}]": int(row[7])
        for row in rows
        if row[3] == "0A" and row[1].endswith(f":{place[1]:04X}")
    }


def _rows(table: str) -> list[list[str]]:
    with contextlib.suppress(OSError), open(table) as file:
        return [line.split() for line in file.readlines()[1:]]
    return []


def _holder(pid: int, proc: str) -> Holder:
    with open(f"{proc}/{pid}/cmdline", "rb") as file, open(f"{proc}/{pid}/stat", "rb") as stat:
        program, *words = file.read(10_000).decode(errors="replace").split("\0")
        state = stat.read().rpartition(b") ")[2][:1]
    command = printable(" ".join([os.path.basename(program), *words]).strip())
    return Holder(pid, shorten(command, MAX_COMMAND_LINE), state in (b"T", b"t"))


class ConnectionAttempts:
    """Connection attempts, by TCP or to Unix sockets, in parallel, each for at most `seconds`.
    Others are skipped.
    """

    def __init__(self, endpoints: Iterable[str], seconds: float) -> None:
        self._seconds = seconds
        self.reasons: dict[str, str] = {}
        """Endpoint -> why the connection failed, empty if it succeeded; absent during the attempt.
        """
        self._threads = []
        for endpoint in endpoints:
            if place := socket_path(endpoint) or address(endpoint):
                # In threads: resolving a name may take longer than the socket's timeout.
                self._threads.append(
                    threading.Thread(target=self._try, args=(endpoint, place), daemon=True)
                )
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

    def _try(self, endpoint: str, place: str | tuple[str, int]) -> None:
        try:
            if isinstance(place, str):
                with socket.socket(socket.AF_UNIX) as probe:
                    probe.settimeout(self._seconds)
                    probe.connect(place)
            else:
                socket.create_connection(place, timeout=self._seconds).close()
            self.reasons[endpoint] = ""
        except (OSError, UnicodeError) as error:
            self.reasons[endpoint] = getattr(error, "strerror", None) or str(error)


def exposure(endpoints: Iterable[str]) -> str:
    """A warning, to follow a node's name, about endpoints beyond loopback. It does not say who can
    reach them: that is up to firewalls and, in a container, to the ports that are published.
    """
    where = ", ".join(endpoints)
    risk = "whoever can reach it can drive, stop and delete robots, and set parameters"
    return f"listens at {where}, and asks for no password or certificate: {risk}"


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
    """Endpoint -> why a connection to it fails, empty if it succeeds; for TCP and Unix sockets."""
    endpoints = [endpoint for endpoint in endpoints if socket_path(endpoint) or address(endpoint)]
    return (
        dict.fromkeys(endpoints, f"no answer within {PATIENCE:g} s")
        | ConnectionAttempts(endpoints, PATIENCE).wait()
    )


def unanswered(endpoints: Iterable[str], within: float) -> str:
    """Why no Zenoh node answers at `endpoints`, and what to do, in one line about the first with a
    known reason.
    """
    reasons = reached(endpoints)
    for endpoint, reason in reasons.items():
        if here := holders(endpoint):
            return (
                f"{endpoint} is held by {' and '.join(map(str, here))}, which does not answer; "
                f"{here[0].fix}"
            )
        if not reason:
            return (
                f"{endpoint} accepts connections but does not speak Zenoh; check what listens there"
            )
    where = ", ".join(endpoints)
    return (
        f"no answer from {where} within {within:g} s; check address and network, and what "
        "listens there"
    )


def rejection(endpoint: str, folder: str) -> str:
    """Why a router at a TLS endpoint and the member of a folder reject each other; empty if they do
    not, or if nothing answers.
    """
    host, port = address(endpoint) or ("", 0)
    try:
        context = ssl.create_default_context(cafile=f"{folder}/ca.pem")
        context.load_cert_chain(f"{folder}/cert.pem", f"{folder}/key.pem")
        with (
            socket.create_connection((host, port), timeout=REFUSED) as plain,
            context.wrap_socket(plain, server_hostname=host) as link,
        ):
            # it refuses our certificate only after the handshake; if it accepts it, it sends
            # nothing
            link.recv(1)
    except ssl.SSLCertVerificationError as error:
        return f"{endpoint} is not a router of this authority: {error.verify_message}"
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).lower().replace("_", " ")
        return f"{endpoint} refuses the certificate in {folder}: {reason}"
    except OSError:  # nothing listens there, or it waits
        pass
    return ""
