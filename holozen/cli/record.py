"""`holozen record`: what comes on the keys, into a bag."""

import argparse
import json
import threading
import time
from typing import TYPE_CHECKING

from holozen import connection
from holozen.cli.screen import Line
from holozen.flags import Parser, key, number
from holozen.process import stop_event
from holozen.tell import printable, say

if TYPE_CHECKING:
    from holozen.bag.intake import Intake
    from holozen.bag.recorder import Recorder
    from holozen.bag.writer import BagWriter

FLUSH = 1.0  # s; a killed recorder loses at most what came since
IDLE = 0.01  # s between two looks at an empty intake
TOLD = {True: 0.5, False: 5.0}  # s between two lines, in a terminal and elsewhere


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen record",
        description="Write what comes on keys into an MCAP file, until Ctrl-C. --wire cdr is for the tools of ROS 2.",
        epilog="example: holozen record odom cmd_vel -o square",
    )
    parser.add_argument("keys", nargs="*", type=key, metavar="KEY", help="a key or key expression, such as */odom")
    parser.add_argument("-a", "--all", action="store_true", help="every key")
    parser.add_argument("-o", "--output", metavar="NAME", help="write NAME.mcap (default: holozen_DATE-TIME.mcap)")
    parser.add_argument("--max-size", type=number(0.1, 1e6, "MB"), metavar="MB",
        help="begin a new file when one has this size: NAME_0.mcap, NAME_1.mcap, ...")  # fmt: skip
    parser.add_argument("--max-duration", type=number(0.1, 1e9, "s"), metavar="S", help="end after S seconds")
    parser.add_argument(
        "--use-sim-time", action="store_true", help="times of the sim's clock, which are those of the stamps"
    )
    parser.add_argument("--json", action="store_true", help="the figures as one JSON object a line")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    arguments = parser()
    args = arguments.parse_args(argv)
    if bool(args.keys) == args.all:
        arguments.error("name the keys to record, or use -a for all")
    from holozen.bag.writer import BagWriter

    name = args.output or time.strftime("holozen_%Y_%m_%d-%H_%M_%S")
    stop = stop_event()
    try:
        writer = BagWriter(name, round((args.max_size or 0) * 1e6), "ros2" if args.wire == "cdr" else "")
    except OSError as error:
        say(f"holozen record: cannot write {error.filename or name}: {error.strerror}{_mend(error)}")
        return 1
    return _record(args, writer, stop)


def _mend(error: OSError) -> str:
    return "; choose another name with -o" if isinstance(error, FileExistsError) else ""


def _record(args: argparse.Namespace, writer: "BagWriter", stop: threading.Event) -> int:
    from holozen.bag.errors import BagError
    from holozen.bag.intake import DEPTH, Intake
    from holozen.bag.recorder import Recorder
    from holozen.bag.simtime import SimTime
    from holozen.bus import Bus

    failed = ""
    try:
        with Bus("record", connection.from_arguments(args), patience=3.0, stop=stop) as bus, Intake() as intake:
            for expression in _expressions(args):
                tap = bus.tap(expression, DEPTH)
                tap.ends.append(bus.announce("sub", "any/msg/Any", expression))
                intake.listen(tap)
            say(f"recording {'every key' if args.all else ' '.join(args.keys)} into {writer.files[0]}; Ctrl-C ends it")
            recorder = Recorder(
                intake, writer, bus.graph(), args.wire == "cdr", SimTime() if args.use_sim_time else None
            )
            progress = Progress(args.json, intake, recorder, writer)
            try:
                _until(stop, args.max_duration, recorder, writer, progress)
                intake.close()
                while not writer.full and recorder.write_some():
                    pass
                writer.close()
            except BagError as error:
                writer.abandon()
                failed = str(error)
    except BaseException:
        writer.close()
        raise
    return progress.end(failed or writer.full)


def _until(
    stop: threading.Event, seconds: float | None, recorder: "Recorder", writer: "BagWriter", progress: "Progress"
) -> None:
    """Write until `stop` is set, `seconds` are over or the disk is full."""
    begun = flushed = time.monotonic()
    while not (stop.is_set() or writer.full):
        now = time.monotonic()
        if seconds is not None and now - begun >= seconds:
            return
        if not recorder.write_some():
            stop.wait(IDLE)
        if now - flushed >= FLUSH:
            writer.flush()
            flushed = now
        progress.tell(now)


def _expressions(args: argparse.Namespace) -> list[str]:
    """The keys to listen on, without those that another one includes: nothing shall be recorded twice."""
    from holozen.graph import includes

    different = list(dict.fromkeys(["**"] if args.all else [*args.keys, *(["clock"] if args.use_sim_time else [])]))
    return [one for one in different if not any(other != one and includes(other, one) for other in different)]


class Progress:
    """Tells how far it is: a line that is written over in a terminal, else one now and then."""

    def __init__(self, as_json: bool, intake: "Intake", recorder: "Recorder", writer: "BagWriter") -> None:
        self._json, self._intake, self._recorder, self._writer = as_json, intake, recorder, writer
        self._over = Line(hidden=as_json)
        self._begun = self._told = time.monotonic()

    def tell(self, now: float) -> None:
        """Say it, if it was not said lately."""
        if now - self._told < (1.0 if self._json else TOLD[self._over.shown]):
            return
        self._told = now
        if self._json:
            print(json.dumps(self._figures()), flush=True)
        elif self._over.shown:
            self._over.show(self._line())
        else:
            say(self._line())

    def end(self, failed: str) -> int:
        """The last words; the exit code."""
        files = [str(path) for path in self._writer.files]
        self._over.show("")
        if self._json:
            print(json.dumps(self._figures() | {"files": files, "error": failed}), flush=True)
        elif files:
            print(printable(f"{', '.join(files)}: {self._line()}"), flush=True)
        if failed:
            say(f"holozen record: ended: {failed}; all that was written before can be read")
        elif not files and self._recorder.early:
            say("holozen record: no file is left: nothing came on clock, so nobody knows the sim's time")
        elif not files:
            say("holozen record: nothing came, so no file is left; `holozen topic list` shows who publishes")
        return 1 if failed or not files else 0

    def _figures(self) -> dict[str, object]:
        return {
            "seconds": round(time.monotonic() - self._begun, 1),
            "messages": self._writer.messages,
            "bytes": self._writer.size,
            "dropped": self._intake.dropped + self._recorder.refused,
            "lost": self._intake.lost,
            "overran": self._intake.overran,
        }

    def _line(self) -> str:
        its = self._figures()
        text = f"{its['seconds']} s, {its['messages']} messages, {self._writer.size / 1e6:.2f} MB"
        text += f", {its['dropped']} dropped" if its["dropped"] else ", none dropped"
        text += f", {its['lost']} lost before they came" if its["lost"] else ""
        return text + (f", overran {its['overran']} times" if its["overran"] else "")
