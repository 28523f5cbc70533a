"""A stop that needs no network: each sim and each base answers `stop` on a Unix socket that only
its user can reach.

`holozen stop` asks all sockets of its user first. The server is a thread, which goes on while
Zenoh's threads, or a call to Zenoh in the loop that moves the robots, hang.
"""

import contextlib
import errno
import json
import os
import socket
import stat
import threading
import time
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from holozen.command.outcome import UNKNOWN_CALLER
from holozen.command.stop_files import default_folder
from holozen.console import report
from holozen.system import IS_LINUX
from holozen.transport.samples import Declared

# below the folder of state that no flag changes: where a stop and a robot meet without one
FOLDER = "local"
HELD_UP = 0.3  # s without a pass of the loop after which a stop is answered for it
# s for the processes of this machine to answer a stop; meanwhile those elsewhere are not asked.
# What a busy machine answers later counts too.
ANSWERS = 0.6
LARGEST = 1 << 20  # bytes of a request, and of a reply: more than the kernel sends at once
BUFFER = 1 << 18  # bytes for it in the kernel
FULL = (errno.EAGAIN, errno.ENOBUFS)  # the receiver has as many as it may
ATTEMPTS, AGAIN = 10, 0.01  # to answer, and s between two
LEFT = 60.0  # s after which a caller of another machine has ended
HANGS = "its process hangs and drives nothing; it is still stopped when the process goes on"
TURNS = "its process hangs, and has no guard that stops its wheels: use the robot's own switch"


class Served(NamedTuple):
    """A robot that this process serves: its name on the wire, empty at the root, and the one that
    it shows.
    """

    robot: str
    name: str


class LocalStop(NamedTuple):
    """What a process of this machine answered for one of its robots. `session`: the id of its Zenoh
    session.
    """

    robot: str
    name: str
    session: str
    confirmed: bool
    message: str


class Order:
    """A stop of these robots that waits for the loop; `done` is set once it has been obeyed."""

    def __init__(self, robots: list[Served], by: str) -> None:
        self.robots, self.by, self.done = robots, by, threading.Event()
        self.message = ""  # what the caller should know


class LocalStops(Declared):
    """Answers stops from this machine until the bus is closed.

    `robots` lists what this process serves in its `networks`. `write(robot, by)` keeps a stop that
    the loop cannot take now. `stands`: whether a robot stands while the loop hangs. Both are called
    in the thread of the socket.

    Where there can be no socket it is reported, and stops have to come over the network.
    """

    def __init__(
        self,
        session: str,
        networks: Sequence[str],
        robots: Callable[[], Iterable[Served]],
        write: Callable[[str, str], object] | None,
        *,
        stands: bool,
        reporter: str,
    ) -> None:
        super().__init__()
        self._session, self._networks, self._robots, self._write = (
            session,
            _from_here(networks),
            robots,
            write,
        )
        self._stands = stands
        self._waiting = deque[Order]()
        self._socket: socket.socket | None = None
        if not (parent := default_folder()):
            return
        try:
            folder = _own_folder(parent / FOLDER)
            marks = "-".join(sorted(map(_mark, self._networks)))
            self._path = folder / f"{os.getpid()}-{os.urandom(4).hex()}-{marks}.stop"
            self._socket = _bound(self._path)
        except OSError as error:
            why = error.strerror or error
            report(
                f"{reporter}: {parent / FOLDER}: {why}: `holozen stop` reaches this process over "
                "the network alone"
            )
            return
        self.ends = [self]
        self.thread = threading.Thread(target=self._serve, args=(self._socket,), daemon=True)
        self.thread.start()

    def take(self) -> Iterator[Order]:
        """The stops that came since the last call, each to be obeyed before the next is taken.
        Cheap without any.
        """
        while self._waiting:
            order = self._waiting.popleft()
            yield order
            order.done.set()

    def undeclare(self) -> None:
        """Remove the socket."""
        if self._socket:
            self._path.unlink(missing_ok=True)
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)  # which ends the thread's recvfrom

    def leave_to_parent(self, _refuse: Callable[..., Any]) -> None:
        """Close the socket in a forked process, where nothing reads it."""
        if self._socket:
            self._socket.close()
        self._socket, self.ends, self.thread = None, [], None

    def _serve(self, here: socket.socket) -> None:
        with here:
            while self.ends:
                try:
                    if request := here.recv(LARGEST):
                        self._answer(here, json.loads(request))
                # the caller has left, or is none of ours
                except (OSError, ValueError, TypeError, KeyError):
                    time.sleep(0.001)

    def _answer(self, here: socket.socket, asked: dict[str, Any]) -> None:
        # To a name, not to the sender's address, which is a path that may be valid in its own
        # process alone.
        reply = self._path.with_name(Path(asked["reply"]).name)
        by = str(asked["by"]) or UNKNOWN_CALLER
        rows = self._stop(by, set(asked["robots"]), set(asked["networks"]))
        with _address(reply) as address:
            _send(here, json.dumps(rows).encode(), address)

    def _stop(self, by: str, wanted: set[str], networks: set[str]) -> list[LocalStop]:
        if not networks & self._networks:
            return []
        robots = [
            one
            for one in self._robots()
            if not wanted or wanted & {one.robot, one.robot or one.name}
        ]
        if not robots:
            return []
        order = Order(robots, by)
        self._waiting.append(order)
        if not order.done.wait(HELD_UP) and self._write:
            for one in robots:
                self._write(one.robot, by)
        if order.done.is_set():  # perhaps while that was written
            confirmed, message = True, order.message
        else:
            confirmed, message = self._stands, HANGS if self._stands else TURNS
        return [LocalStop(*one, self._session, confirmed, message) for one in robots]


class Answers:
    """What the processes of this machine answer to a stop, those whose sockets were `asked`.

    received: all answers so far
    """

    def __init__(self, here: socket.socket | None = None, asked: Iterable[Path] = ()) -> None:
        self._socket = here
        self._missing = {path.name: path for path in asked}
        self.received: list[LocalStop] = []

    def read(self, wait: float = 0.0) -> list[LocalStop]:
        """The answers since the last call, and those that come within `wait` s until none is
        missing.
        """
        deadline = time.monotonic() + wait
        new: list[LocalStop] = []
        while self._socket and self._missing:
            self._socket.settimeout(max(deadline - time.monotonic(), 0.0))
            try:
                answer, address = self._socket.recvfrom(LARGEST)
            except OSError:  # there is none yet
                break
            self._missing.pop(Path(address).name, None)
            new += [LocalStop(*row) for row in json.loads(answer)]
        self.received += new
        return new

    def missing(self) -> list[int]:
        """The pids of those that have not answered, and still run."""
        there = [name for name, path in self._missing.items() if not _is_gone(path)]
        return [int(name.partition("-")[0]) for name in there]


@contextlib.contextmanager
def stop_here(networks: Sequence[str], robots: Iterable[str], by: str) -> Iterator[Answers]:
    """Stop `robots`, or all without any, of this user's processes on this machine that are in one
    of the `networks`. Answers can be read while the context lasts; there are none where no process
    has a socket.
    """
    parent = default_folder()
    if not parent or not (parent / FOLDER).is_dir():
        yield Answers()
        return
    try:
        folder = _own_folder(parent / FOLDER)
        path = folder / f"{os.getpid()}-{os.urandom(4).hex()}.reply"
        here = _bound(path)
    except OSError as error:
        report(
            f"holozen stop: {parent / FOLDER}: {error.strerror or error}: stops go over the "
            "network alone"
        )
        yield Answers()
        return
    mine = _from_here(networks)
    order = {"by": by, "robots": [*robots], "networks": sorted(mine), "reply": path.name}
    request = json.dumps(order).encode()
    with here:
        try:
            marks = {*map(_mark, mine)}
            there = [
                one
                for one in sorted(folder.glob("*.stop"))
                if not marks.isdisjoint(one.stem.split("-")[2:])
            ]
            yield Answers(here, [one for one in there if _ask(here, one, request)])
        finally:
            path.unlink(missing_ok=True)
            _remove_replies(folder)


def _from_here(networks: Iterable[str]) -> set[str]:
    """The networks as this process sees them: a network namespace, such as a container, has a
    loopback of its own.
    """
    namespace = os.stat("/proc/self/ns/net").st_ino if os.path.exists("/proc/self/ns/net") else ""
    return {f"{namespace} {network}" for network in networks}


def _mark(network: str) -> str:
    """What the names of sockets hold of a network, so that no process of another one is waited
    for.
    """
    return f"{zlib.crc32(network.encode()):08x}"


def _send(here: socket.socket, answer: bytes, address: str) -> None:
    """Send an answer; again if the caller, whom a busy machine holds up, has ten already."""
    for _ in range(ATTEMPTS):
        try:
            here.sendto(answer, socket.MSG_DONTWAIT, address)
            return
        except OSError as error:
            if error.errno not in FULL:
                raise
        time.sleep(AGAIN)


def _ask(here: socket.socket, path: Path, request: bytes) -> bool:
    """Send a request; returns whether the process is there. Removes the socket of one that has
    ended.
    """
    try:
        with _address(path) as address:
            here.sendto(request, socket.MSG_DONTWAIT, address)
    except ConnectionRefusedError:
        path.unlink(missing_ok=True)
        return False
    except OSError as error:
        return error.errno in FULL  # of stops already, or it has just ended
    return True


def _is_gone(path: Path) -> bool:
    """Whether the process that has made a socket has closed it."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end, _address(path) as address:
            end.connect(address)
    except OSError as error:  # with another, that cannot be known now
        return isinstance(error, ConnectionRefusedError | FileNotFoundError)
    return False


def _remove_replies(folder: Path) -> None:
    """Remove what callers that were killed have left. Another machine may share the folder: those
    that may be at work there stay.
    """
    for path in folder.glob("*.reply"):
        with contextlib.suppress(OSError):  # it has gone
            if time.time() - path.stat().st_mtime > LEFT and _is_gone(path):
                path.unlink()


def _own_folder(path: Path) -> Path:
    """Make the folder of the sockets. Raises OSError if others may enter it."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o077:
        raise PermissionError(0, "it is not a folder of yours with mode 0700")
    return path


def _bound(path: Path) -> socket.socket:
    """A new socket at `path`. Datagrams: however many descriptors are in use, no stop has to be
    accepted first.
    """
    here = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        with _address(path) as address:
            here.bind(address)
        path.chmod(0o600)
        for size in (socket.SO_SNDBUF, socket.SO_RCVBUF):  # macOS has 2 KB
            with contextlib.suppress(OSError):  # more than it allows
                here.setsockopt(socket.SOL_SOCKET, size, BUFFER)
    except BaseException:
        here.close()
        raise
    return here


@contextlib.contextmanager
def _address(path: Path) -> Iterator[str]:
    """The address of a socket, also where the path is longer than the kernel takes."""
    if len(os.fsencode(path)) < 100:
        yield str(path)
        return
    if not IS_LINUX:
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), str(path))
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)
