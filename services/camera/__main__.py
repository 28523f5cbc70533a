"""The camera process: renders what robots see, apart from the sim, since a picture takes longer
than a step.

The engine may hang, or crash, in a picture: of a camera inside a mesh, for one. So a process of its
own renders, and this one starts it again, without the camera whose picture ended it.
"""

import argparse
import mmap
import os
import signal
import sys

from holozen import flags
from holozen.bus import Bus
from holozen.console import report
from holozen.messages import Exposure
from holozen.process import SIGNALS, dies_with_parent, stop_event
from holozen.transport import connection
from holozen.transport.errors import BusError

from .watch import MAX_PICTURE_TIME, Watch

NICE = 10  # the sim has priority
LARGEST = 4_000_000  # bytes of an exposure
# SIGPROF: it took too long
CRASHES = (signal.SIGPROF, signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE)


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen camera",
        description="render what the cameras of robots see; the sim starts it with the first "
        "robot that has a camera",
        epilog="example: holozen camera --exposures exposures",
    )
    add = parser.add_argument
    add(
        "--exposures",
        default="exposures",
        metavar="KEY",
        help="the exposures of one sim (default: %(default)s)",
    )
    flags.add_json(parser)
    connection.add_arguments(parser, role="sim")
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    os.nice(NICE)
    watch = Watch(mmap.mmap(-1, mmap.PAGESIZE))
    ended = False

    def end(number: int, _frame: object) -> None:
        nonlocal ended
        ended = True
        os.kill(child, number)

    before = {number: signal.getsignal(number) for number in SIGNALS}
    follow = dies_with_parent()
    while True:
        # until both processes have their handlers
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        if (child := os.fork()) == 0:
            follow()
            for number, handler in before.items():
                signal.signal(number, handler)
            os._exit(_render(args, watch))
        for number in SIGNALS:
            signal.signal(number, end)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if ended or -code not in CRASHES or not watch.name:
            return code if code >= 0 else 128 - code
        why = (
            f"took more than {MAX_PICTURE_TIME:g} s"
            if -code == signal.SIGPROF
            else "ended the renderer"
        )
        report(
            f"camera: a picture of {watch.name} {why}; it gets no more pictures, the other "
            "cameras do"
        )
        watch.drop()


def _render(args: argparse.Namespace, watch: Watch) -> int:
    """Render until a signal comes. Returns the exit code."""
    stop = stop_event()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    try:
        from holozen.robot.files import description, reader

        reader.start(description)
        from .studio import Studio  # loads the engine, which --help does not need

        with Bus("camera", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            report(f"camera: renders what comes on {args.exposures}")
            exposures = bus.subscribe(args.exposures, Exposure, depth=64, limit=LARGEST)
            Studio(bus, exposures, watch).run(stop)
    except BusError as error:
        report(f"camera: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
