"""How the processes of one machine meet: in a multicast group on loopback, or at the sockets of a
private folder.

Zenoh's own scouting makes the links of a group: a newcomer asks, all who are there answer, and it
connects to them. The kernel knows how many there are, and who answers is alive. So nobody waits for
one that hangs, and a verb knows when it has met all.
"""

import _socket  # socket itself takes 5 ms to load
import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import zenoh

from holozen.console import report
from holozen.system import IS_LINUX
from holozen.transport.connection import GROUP, UNIX, Connection, are_near
from holozen.transport.errors import BusError
from holozen.transport.loopback import confine, is_taken, sockets

if TYPE_CHECKING:
    from holozen.transport.listeners import ConnectionAttempts

QUICK = 0.3  # s; a link on one machine is up by then
NOTICE = 1.0  # s without a link before the user is informed
PATIENCE = 5.0  # s for others to answer; a link with a delay of 0.5 s one way takes 3 s
TURN = 0.3  # s to wait for another process that is opening its session
ECHO = 3.0  # s for a process to hear itself in its group
RUNNING_CHECK_PERIOD = 0.05  # s between two checks which of the silent processes run
HELD_CHECK_PERIOD = 0.1  # s between two checks which endpoints are held
NEW = 1.0  # s after a question, in which its answers count as new
MAX_ANSWERS = 4096


def new_id(connects: bool = True) -> str:
    """An id for a session, greater than those of all sessions that were opened on this machine
    before.

    Of two peers the one with the greater id connects: the newcomer, which has just asked who is
    there. Foreign ids are random: it is greater than those if it `connects` to all that it hears
    of, else less.
    """
    # Zenoh compares the last byte first, and takes no zero in front.
    last = "ff" if connects else "01"
    return os.urandom(8).hex().lstrip("0") + time.monotonic_ns().to_bytes(7, "little").hex() + last


@contextlib.contextmanager
def turn(connection: Connection) -> Iterator[None]:
    """One process at a time takes its id and joins the others, so that of each two the later one
    finds the other.

    One that hangs in it holds the others up for TURN at most: they may then find it, or it them, a
    second later.
    """
    lock = _folder_lock(connection.private) if connection.private else _name_lock(connection.group)
    deadline = time.monotonic() + TURN
    while not lock() and time.monotonic() < deadline:
        time.sleep(0.001)
    try:
        yield
    finally:
        lock(False)


def _name_lock(port: int) -> Callable[..., bool]:
    """Takes, or releases, the lock of a group: the abstract name of a Unix socket, which needs no
    file nor rights.
    """
    held = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)

    def lock(take: bool = True) -> bool:
        if not take or not IS_LINUX:
            held.close()
            return True
        try:
            held.bind(f"\0holozen-group-{port}")
        except OSError:
            return False
        return True

    return lock


def _folder_lock(folder: str) -> Callable[..., bool]:
    """Takes, or releases, the lock of a folder."""
    import fcntl

    held = os.open(folder, os.O_RDONLY)

    def lock(take: bool = True) -> bool:
        if not take:
            os.close(held)
            return True
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True

    return lock


class Others:
    """The other processes that a session meets on this machine, as far as they can be counted.

    `who` is how people know where they are, `listening` the endpoints of those who have answered.
    """

    who = ""

    def __init__(self) -> None:
        self.listening: set[str] = set()

    def refresh(self) -> None:
        """Ask again who is there, if that was not just done."""

    def count(self) -> int | None:
        """How many there are, those that hang included; None where that cannot be known."""
        return None

    def answered(self) -> set[str]:
        """The ids of the sessions that have answered by now."""
        return set()

    def are_busy(self) -> bool:
        """Whether one of those that do not answer runs: it may be slow."""
        return False

    def awaited(self, passed: float) -> str:
        """Those that may still answer after `passed` seconds, as text; empty if there are none."""
        count = self.count()
        may_answer = passed < QUICK if count is None else count > 0
        return self.who if may_answer else ""

    def notice(self, awaited: str, lasting: bool) -> str:
        """What the user is told when none has answered for a while."""
        return self.silent() if lasting else f"waiting for an answer from {awaited}"

    def come_later(self) -> bool:
        """Whether a lasting process goes on without them: it meets those that wake up."""
        return True

    def silent(self) -> str:
        """Why they do not answer, and what to do."""
        return ""

    def close(self) -> None:
        """Ask no more."""


class Group(Others):
    """The others in a multicast group, asked by Zenoh's scout."""

    def __init__(self, port: int, config: zenoh.Config, session: Any) -> None:
        super().__init__()
        self.who = f"the group {GROUP}:{port} on loopback"
        self._port, self._config, self._own = port, config, str(session.zid())
        self._is_busy, self._looked = False, 0.0  # s; when that was looked up
        self.ask()

    def ask(self) -> None:
        """Ask anew, and forget who answered before. Raises OSError where scouting cannot be kept on
        loopback.
        """
        self._answered: set[str] = set()
        self.listening.clear()
        channel: Any = zenoh.handlers.RingChannel(MAX_ANSWERS)
        self._scout = zenoh.scout(channel, what="peer|router", config=self._config)
        self._asked = time.monotonic()
        confine()

    def refresh(self) -> None:
        """Ask again who is there, if that was not just done. Raises BusError."""
        if time.monotonic() - self._asked > NEW:
            self.close()
            try:
                self.ask()
            except (OSError, zenoh.ZError) as error:
                raise BusError(f"cannot ask who is on loopback: {error}") from None

    def hears_itself(self, within: float) -> bool:
        """Whether this session has answered too, in `within` s: if not, there is no multicast on
        loopback.
        """
        return _in_time(lambda: self._own in self._all(), within)

    def has_listener(self, endpoint: str, within: float) -> bool:
        """Whether one of those who answer listens at an endpoint; the last ones may take `within` s
        to answer.
        """
        return _in_time(lambda: bool(self._all()) and endpoint in self.listening, within)

    def answered(self) -> set[str]:
        """The ids of the sessions that have answered by now."""
        return self._all() - {self._own}

    def count(self) -> int | None:
        """How many there are, those that hang included; None where that cannot be known."""
        try:
            return max(0, len(sockets(self._port)) - 1)
        except (OSError, ValueError, IndexError):
            return None

    def are_busy(self) -> bool:
        """Whether one of those that do not answer runs: it may be slow. Looked up now and then:
        /proc is long.
        """
        now = time.monotonic()
        if now >= self._looked + RUNNING_CHECK_PERIOD:
            from holozen.transport.listeners import members

            running = [
                one
                for one in members(self._port)
                if one.pid not in (0, os.getpid()) and not one.stopped
            ]
            self._is_busy, self._looked = len(running) > len(self.answered()), time.monotonic()
        return self._is_busy

    def silent(self) -> str:
        """Why they do not answer, and what to do."""
        from holozen.transport.listeners import members

        here = [one for one in members(self._port) if one.pid != os.getpid()]
        here = [one for one in here if one.stopped] or here
        if not here:
            return f"no answer in {self.who}"
        return f"{' and '.join(map(str, here))} in {self.who} does not answer; {here[0].fix}"

    def close(self) -> None:
        """Ask no more."""
        # closed, or in use, by another thread
        with contextlib.suppress(zenoh.ZError, RuntimeError):
            self._scout.stop()  # type: ignore[no-untyped-call]

    def _all(self) -> set[str]:
        # closed, or in use, by another thread
        with contextlib.suppress(zenoh.ZError, RuntimeError):
            while hello := self._scout.try_recv():
                self._answered.add(str(hello.zid))
                self.listening.update(map(str, hello.locators))
        return self._answered


def _in_time(condition: Callable[[], bool], within: float) -> bool:
    deadline = time.monotonic() + within
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.0005)
    return True


class Folder(Others):
    """The others at the sockets of a private folder, to which a session connects."""

    def __init__(self, folder: str, paths: Sequence[str], session: Any) -> None:
        super().__init__()
        self.who, self._paths, self._session = folder, paths, session

    def count(self) -> int | None:
        """How many there are, those that hang included; None where that cannot be known."""
        from holozen.transport.private import is_locked

        with contextlib.suppress(OSError):
            return sum(map(is_locked, self._paths))
        return None

    def answered(self) -> set[str]:
        """The ids of the sessions that have answered by now."""
        return set(map(str, [*self._session.info.peers_zid(), *self._session.info.routers_zid()]))

    def silent(self) -> str:
        """Why they do not answer, and what to do."""
        from holozen.transport.listeners import unanswered

        return unanswered([UNIX + path for path in self._paths], PATIENCE)


class Endpoints:
    """The processes that may listen at the endpoints to which a session connects.

    It waits for those of this machine that hold an endpoint, and for those of other machines until
    an attempt to connect to them fails.
    """

    def __init__(self, endpoints: Sequence[str], patience: float) -> None:
        self._near = [one for one in endpoints if are_near([one])]
        self._far = [
            one for one in endpoints if one.startswith(("tcp/", "tls/")) and one not in self._near
        ]
        self._patience = patience
        self._held = [*filter(is_taken, self._near)]
        self._checked = time.monotonic()
        # to reach the far ones; None until it has waited a while
        self._attempts: ConnectionAttempts | None = None

    def awaited(self, passed: float) -> str:
        """Those that may still answer after `passed` seconds, as text; empty if there are none."""
        return ", ".join(self._waiting(passed))

    def notice(self, awaited: str, lasting: bool) -> str:
        """What the user is told when none has answered for a while."""
        return f"waiting for an answer from {awaited}"

    def come_later(self) -> bool:
        """Whether a lasting process goes on without them: links to other machines come up later by
        themselves.
        """
        return not self._held

    def silent(self) -> str:
        """Why they do not answer, and what to do."""
        from holozen.transport.listeners import unanswered

        return unanswered(self._waiting(self._patience), self._patience)

    def _waiting(self, passed: float) -> list[str]:
        now = time.monotonic()
        if now - self._checked > HELD_CHECK_PERIOD:
            self._held, self._checked = [*filter(is_taken, self._near)], now
        if self._far and self._attempts is None and passed > QUICK:
            from holozen.transport.listeners import ConnectionAttempts  # loads socket

            self._attempts = ConnectionAttempts(self._far, self._patience)
        attempts = self._attempts
        return self._held + [
            one for one in self._far if attempts is None or not attempts.failed(one)
        ]


def wait_for_link(
    connected: Callable[[], bool],
    awaited: Others | Endpoints,
    lasting: bool,
    patience: float,
    stop: threading.Event,
) -> None:
    """Wait for a link to any of those `awaited`, at most `patience` s, as long as any of them may
    answer.

    Raises BusError if they are there and none answers. A `lasting` process goes on without those
    that come later. Exits with code 0 when `stop` is set.
    """
    began, has_reported = time.monotonic(), False
    while not connected():
        passed = time.monotonic() - began
        names = awaited.awaited(passed)
        if not names:
            return
        if passed > NOTICE and not has_reported:
            has_reported = True
            report(awaited.notice(names, lasting))
        if lasting and has_reported and awaited.come_later():
            return
        if passed > patience:
            raise BusError(awaited.silent())
        if stop.wait(0.001 if passed < QUICK else 0.02):
            raise SystemExit(0)
