"""`holozen router`: a Zenoh router, the meeting point of processes on several machines or in containers."""

import argparse

from holozen.bus import Bus
from holozen.console import report
from holozen.flags import Parser
from holozen.process import POLL, stop_event
from holozen.transport import connection


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen router",
        description="Run a Zenoh router.",
        epilog="example: holozen router --listen tcp/0.0.0.0:7447",
    )
    connection.add_arguments(parser)
    parser.set_defaults(mode="router")
    return parser


def main(argv: list[str]) -> int:
    where = connection.from_arguments(parser().parse_args(argv)).replace(mode="router")
    stop = stop_event()
    while not stop.is_set():
        members = _members(where)
        with Bus("router", where, lasting=True) as bus:
            report(f"router: listens at {', '.join(bus.listens)}")
            while not stop.wait(POLL) and _members(where) == members:
                pass
    return 0


def _members(where: connection.Connection) -> tuple[int, int]:
    """Which list of members there is. Zenoh reads access rules only at its start, so with a new list it starts anew."""
    if not where.secure:
        return 0, 0
    from holozen.transport.members import version  # loads cryptography

    try:
        return version(where.secure)
    except OSError:
        return 0, 0
