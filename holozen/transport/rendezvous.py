"""Meeting points: the endpoints where processes meet. Each long-running process holds at most one of them.

When a process loses one, another takes it over. Since no process holds two, processes find each other even if the
holder of the first one is suspended, or does not speak Zenoh. Zenoh can retry a taken port by itself, but such a
session takes 10 s to close; so this module asks the kernel whether a point is free.
"""

import errno
import os
import threading
import time
from collections.abc import Callable, Iterable, Sequence

from holozen.console import report
from holozen.transport.connection import are_near, socket_path
from holozen.transport.errors import BusError

POLL = 0.2  # s between two checks of the points
QUICK = 0.3  # s; a link on one machine is up by then
NOTICE = 1.0  # s without a link before the user is informed
PATIENCE = 5.0  # s for others to answer; a link with a delay of 0.5 s one way takes 3 s

IN_USE = os.strerror(errno.EADDRINUSE)

held: set[str] = set()
"""The points that any session of this process holds."""

Opener = Callable[[str], Callable[[], None] | None]


def hold(points: Sequence[str], closing: threading.Event, open_point: Opener) -> threading.Thread:
    """Hold the first of `points` that is free, from a thread, until `closing` is set.

    `open_point` opens one and returns a function that closes it, or None if another process was faster.
    """
    thread = threading.Thread(target=_hold, args=(points, closing, open_point), daemon=True)
    thread.start()
    return thread


def _hold(points: Sequence[str], closing: threading.Event, open_point: Opener) -> None:
    mine, close = len(points), _nothing
    while True:
        others = held & set(points) - set(points[mine : mine + 1])  # of other sessions of this process
        for number, point in enumerate(points[: 0 if others else mine]):
            if is_free(point) and (opened := open_point(point)):
                close()
                held.difference_update(points[mine : mine + 1])
                held.add(point)
                mine, close = number, opened
                break
        if closing.wait(POLL):
            held.difference_update(points[mine : mine + 1])
            return close()


def _nothing() -> None:
    """No session to close."""


def is_free(endpoint: str) -> bool:
    """Whether an endpoint such as tcp/127.0.0.1:7447, or a Unix socket, can be listened on. Makes no connection."""
    return listen_error(endpoint) == ""


def listen_error(endpoint: str) -> str:
    """Why an endpoint, TCP, TLS or Unix, cannot be listened on now, in the system's words (IN_USE); else empty."""
    if path := socket_path(endpoint):
        from holozen.transport.private import is_locked

        try:
            return IN_USE if is_locked(path) else ""
        except OSError as error:
            return error.strerror or str(error)
    import socket  # takes 5 ms to load, which a verb that meets a robot does not need

    host, _, port = endpoint.partition("?")[0].partition("#")[0].partition("/")[2].rpartition(":")
    with socket.socket(socket.AF_INET6 if host[:1] == "[" else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host.strip("[]"), int(port)))
        except (OSError, ValueError, OverflowError) as error:
            return getattr(error, "strerror", None) or str(error) or "no address"
    return ""


def is_taken(endpoint: str) -> bool:
    """Whether another process holds an endpoint of this machine."""
    return not endpoint.endswith(":0") and listen_error(endpoint) == IN_USE


def wait_for_link(
    connected: Callable[[], bool],
    endpoints: Iterable[str],
    lasting: bool,
    patience: float,
    stop: threading.Event,
    known: Sequence[str] = (),
) -> None:
    """Wait for a link, at most `patience` s, as long as a process listens at any of `endpoints`. `known`: where one was
    seen to listen.

    Raises BusError if one is held and does not answer. A `lasting` process goes on without remote ones: those links
    come up later. Exits with code 0 when `stop` is set.
    """
    near = [one for one in endpoints if are_near([one])]
    far = [one for one in endpoints if one.startswith(("tcp/", "tls/")) and one not in near]
    attempts = None
    begin = looked = reported = time.monotonic()
    taken = [one for one in near if one in known] or [*filter(is_taken, near)]
    while not connected():
        now = time.monotonic()
        if now - looked > 0.1:
            taken, looked = [*filter(is_taken, near)], now
        if far and attempts is None and now - begin > QUICK:
            from holozen.transport.listeners import Attempts  # loads socket

            attempts = Attempts(far, patience)
        waiting = taken + [one for one in far if attempts is None or not attempts.failed(one)]
        if not waiting:
            return
        if now - begin > NOTICE and reported == begin:
            report(f"waiting for an answer from {', '.join(waiting)}")
            reported = now
        if lasting and not taken and reported > begin:
            return
        if now - begin > patience:
            from holozen.transport.listeners import unanswered

            raise BusError(unanswered(waiting, patience))
        if stop.wait(0.001 if now - begin < QUICK else 0.02):
            raise SystemExit(0)
