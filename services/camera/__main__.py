"""The camera process: renders what robots see, apart from the sim, since a picture takes longer than a step."""

import argparse
import os
import sys

from holozen import flags
from holozen.bus import Bus
from holozen.console import report
from holozen.messages import Exposure
from holozen.process import stop_event
from holozen.transport import connection
from holozen.transport.errors import BusError

NICE = 10  # the sim has priority
LARGEST = 4_000_000  # bytes of an exposure


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen camera",
        description="render what the cameras of robots see; the sim starts it with the first robot that has a camera",
        epilog="example: holozen camera --exposures exposures",
    )
    add = parser.add_argument
    add("--exposures", default="exposures", metavar="KEY", help="the exposures of one sim (default: %(default)s)")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    os.nice(NICE)
    try:
        from holozen.robot import description, reader

        reader.start(description)
        from .studio import Studio  # loads the engine, which --help does not need

        with Bus("camera", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            report(f"camera: renders what comes on {args.exposures}")
            exposures = bus.subscribe(args.exposures, Exposure, depth=64, limit=LARGEST)
            Studio(bus, exposures).run(stop)
    except BusError as error:
        report(f"camera: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
