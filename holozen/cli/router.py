"""`holozen router`: a Zenoh router, the meeting point of processes on several machines or in
containers.
"""

import argparse
import time

from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name, no_arguments
from holozen.console import report
from holozen.process import POLL, stop_event
from holozen.transport import connection


def run(args: argparse.Namespace) -> int:
    """Route until Ctrl-C."""
    args.mode = args.mode or "router"
    stop = stop_event()
    while not stop.is_set():
        where = connection.from_arguments(args)._replace(mode="router")
        members = _members(where)
        with Bus("router", where, lasting=True) as bus:
            report(f"router: listens at {', '.join(bus.listens)}")
            while not (stop.wait(POLL) or _has_expired(bus) or _members(where) != members):
                pass
    return 0


def _has_expired(bus: Bus) -> bool:
    """Whether the router's certificate has expired. It starts again with a new one, or ends: Zenoh
    closes all links then, but those that are made again within the same second stay, and nobody
    else gets in to stop a robot.
    """
    return bus.member is not None and time.time() > bus.member.expires


def _members(where: connection.Connection) -> tuple[int, int]:
    """The version of the list of members. A new list restarts the router: Zenoh reads access rules
    only at start.
    """
    if not where.secure:
        return 0, 0
    from holozen.transport.authenticator import authenticator

    try:
        return authenticator().version(where.secure)
    except OSError:
        return 0, 0


VERBS = by_name(
    Verb("router", "run a Zenoh router", "--listen tcp/0.0.0.0:7447", no_arguments, run, json=None),
)
