"""`holozen router`: a Zenoh router, the meeting point of processes on several machines or in containers."""

import argparse

from holozen.bus import Bus
from holozen.console import report
from holozen.flags import Parser
from holozen.process import stop_event, wait_for_end
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
    with Bus("router", where, lasting=True) as bus:
        report(f"router: listens at {', '.join(bus.listens)}")
        wait_for_end(stop)
    return 0
