"""What the kernel knows of loopback: who is in a group there, and where one can listen. Keeps
scouting there.
"""

import _socket  # socket itself takes 5 ms to load
import errno
import os
import stat
import sys

from holozen.system import IS_LINUX
from holozen.transport.connection import GROUP, HOST, socket_path

IN_USE = os.strerror(errno.EADDRINUSE)
LOOKS = 6  # at a table of the kernel that is longer than a page
PAGE = 1 << 16  # bytes; no page is longer
_HERE = _socket.inet_aton(HOST)
# SO_BINDTODEVICE of Linux, IP_BOUND_IF of macOS; not in `socket` on all systems
_BIND_TO_DEVICE, _BOUND_IF = (25, 25)


def confine() -> None:
    """Bind the sockets of Zenoh's scouting in this process to loopback. Raises OSError.

    Zenoh chooses the interface where it sends, but it also takes what comes in elsewhere: it would
    answer a scout from another machine, if any process has joined the group there, and a forged
    answer would make it connect anywhere.
    """
    folder = "/proc/self/fd" if IS_LINUX else "/dev/fd"
    for name in os.listdir(folder):
        try:
            if not stat.S_ISSOCK(os.fstat(int(name)).st_mode):
                continue
            copy = os.dup(int(name))
        except OSError:  # closed by now
            continue
        try:
            _confine(copy)
        finally:
            os.close(copy)


def _confine(descriptor: int) -> None:
    try:
        one = _socket.socket(fileno=descriptor)
    except OSError:  # another file has that number by now
        return
    try:
        if not _is_of_scouting(one):
            return
        if not IS_LINUX:
            one.setsockopt(_socket.IPPROTO_IP, _BOUND_IF, _socket.if_nametoindex("lo0"))
        # to bind it again takes rights
        elif not one.getsockopt(_socket.SOL_SOCKET, _BIND_TO_DEVICE, 16):
            one.setsockopt(_socket.SOL_SOCKET, _BIND_TO_DEVICE, b"lo\0")
    finally:
        one.detach()


def _is_of_scouting(one: _socket.socket) -> bool:
    """Whether a socket is one that joined a group of ours, or asks there."""
    if (one.family, one.type) != (_socket.AF_INET, _socket.SOCK_DGRAM):
        return False
    sends_there = one.getsockopt(_socket.IPPROTO_IP, _socket.IP_MULTICAST_IF, 4) == _HERE
    return sends_there or one.getsockname()[0] == GROUP


def sockets(port: int) -> list[tuple[str, int]]:
    """The sockets in a group, as /proc/PID/fd names them, with their users' ids. Raises OSError
    where none knows.

    The kernel gives its table a page at a time, and leaves one out where another has just gone. So
    a longer table is read LOOKS times, and what any look shows is there.
    """
    wanted = f"{int.from_bytes(_socket.inet_aton(GROUP), sys.byteorder):08X}:{port:04X}".encode()
    found = dict[tuple[str, int], None]()
    for _ in range(LOOKS):
        pages = _pages("/proc/net/udp")
        rows = [row for line in b"".join(pages).splitlines() if (row := line.split())[1] == wanted]
        found |= dict.fromkeys((f"socket:[{row[9].decode()}]", int(row[7])) for row in rows)
        if len(pages) == 1:
            break
    return [*found]


def _pages(path: str) -> list[bytes]:
    """A table of the kernel, as it was read."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        return [*iter(lambda: os.read(descriptor, PAGE), b"")]
    finally:
        os.close(descriptor)


def listen_error(endpoint: str) -> str:
    """Why an endpoint, TCP, TLS or Unix, cannot be listened on now, in the system's words (IN_USE);
    else empty.

    Makes no connection.
    """
    if path := socket_path(endpoint):
        from holozen.transport.private import is_locked

        try:
            return IN_USE if is_locked(path) else ""
        except OSError as error:
            return error.strerror or str(error)
    host, _, port = endpoint.partition("?")[0].partition("#")[0].partition("/")[2].rpartition(":")
    probe = _socket.socket(
        _socket.AF_INET6 if host[:1] == "[" else _socket.AF_INET, _socket.SOCK_STREAM
    )
    try:
        probe.setsockopt(_socket.SOL_SOCKET, _socket.SO_REUSEADDR, 1)
        probe.bind((host.strip("[]"), int(port)))
    except (OSError, ValueError, OverflowError) as error:
        return getattr(error, "strerror", None) or str(error) or "no address"
    finally:
        probe.close()
    return ""


def is_taken(endpoint: str) -> bool:
    """Whether another process holds an endpoint of this machine."""
    return not endpoint.endswith(":0") and listen_error(endpoint) == IN_USE
