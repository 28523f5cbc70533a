"""`holozen record`: the messages of keys, into a bag."""

import argparse
import errno
import json
import threading
import time
from typing import TYPE_CHECKING

from holozen.cli.verb import Verb, by_name
from holozen.console import Line, printable, report
from holozen.flags import key, number
from holozen.process import stop_event
from holozen.transport import connection

if TYPE_CHECKING:
    from holozen.bag.recorder import Intake, Recorder
    from holozen.bag.writer import BagWriter

FLUSH = 1.0  # s; a killed recorder loses at most what arrived since
IDLE = 0.01  # s between two looks at an empty queue
REPORT_EVERY = {True: 0.5, False: 5.0}  # s between two lines, in a terminal and elsewhere


def run(args: argparse.Namespace) -> int:
    """Record until Ctrl-C, or until --max-duration has passed."""
    if bool(args.keys) == args.all:
        args.error("name the keys to record, or use -a for all")
    from holozen.bag.rosbag2 import RosBagWriter
    from holozen.bag.writer import BagWriter

    name = args.output or time.strftime("holozen_%Y_%m_%d-%H_%M_%S")
    stop = stop_event()
    try:
        limit = round((args.max_size or 0) * 1e6)
        writer = RosBagWriter(name, limit) if args.ros2 else BagWriter(name, limit, "ros2" if _for_ros(args) else "")
    except OSError as error:
        report(f"holozen record: cannot write {error.filename or name}: {error.strerror}{_fix(error)}")
        return 1
    return _record(args, writer, stop)


def _for_ros(args: argparse.Namespace) -> bool:
    return bool(args.ros2) or args.wire == "cdr"


def _fix(error: OSError) -> str:
    if error.errno == errno.ENOSPC:
        return "; free some space, or choose a folder on another disk with -o"
    return "; choose another name with -o" if isinstance(error, FileExistsError) else ""


def _record(args: argparse.Namespace, writer: "BagWriter", stop: threading.Event) -> int:
    from holozen.bag import BagError
    from holozen.bag.recorder import DEPTH, Intake, Recorder, SimTime
    from holozen.bus import Bus

    failed = ""
    try:
        with Bus("record", connection.from_arguments(args), stop=stop) as bus, Intake() as intake:
            for expression in _expressions(args):
                tap = bus.subscribe_raw(expression, DEPTH)
                tap.ends.append(bus.announce("sub", "any/msg/Any", expression))
                intake.listen(tap)
            report(
                f"recording {'every key' if args.all else ' '.join(args.keys)} into {writer.files[0]}; Ctrl-C ends it"
            )
            sim_time = SimTime() if args.use_sim_time else None
            recorder = Recorder(intake, writer, bus.graph(), _for_ros(args), sim_time, bus.definition)
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
    """Write until `stop` is set, `seconds` have passed or the disk is full."""
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
        progress.report(now)


def _expressions(args: argparse.Namespace) -> list[str]:
    """The key expressions to subscribe to; those included in another are dropped, so that nothing is recorded twice."""
    from holozen.transport.graph import includes

    different = list(dict.fromkeys(["**"] if args.all else [*args.keys, *(["clock"] if args.use_sim_time else [])]))
    return [one for one in different if not any(other != one and includes(other, one) for other in different)]


class Progress:
    """Reports progress: on one line that is rewritten in a terminal, else on a line from time to time."""

    def __init__(self, as_json: bool, intake: "Intake", recorder: "Recorder", writer: "BagWriter") -> None:
        self._json, self._intake, self._recorder, self._writer = as_json, intake, recorder, writer
        self._over = Line(hidden=as_json)
        self._begun = self._reported = time.monotonic()

    def report(self, now: float) -> None:
        """Report progress, unless the last report is too recent."""
        if now - self._reported < (1.0 if self._json else REPORT_EVERY[self._over.shown]):
            return
        self._reported = now
        if self._json:
            print(json.dumps(self._figures()), flush=True)
        elif self._over.shown:
            self._over.show(self._line())
        else:
            report(self._line())

    def end(self, failed: str) -> int:
        """Report the result; returns the exit code."""
        files = [str(path) for path in self._writer.files]
        self._over.show("")
        if self._json:
            print(json.dumps(self._figures() | {"files": files, "error": failed}), flush=True)
        elif files:
            print(printable(f"{', '.join(files)}: {self._line()}"), flush=True)
        for name, (count, why) in self._recorder.left_out.items():
            report(f"holozen record: left out {count} messages of {name}: {why}")
        if failed:
            report(f"holozen record: stopped: {failed}; everything written before can be read")
        elif not files and self._recorder.early:
            report("holozen record: no file is left: nothing arrived on clock, so the sim's time is unknown")
        elif not files and self._recorder.left_out:
            report("holozen record: no file is left: a bag for ROS 2 can hold none of these messages")
        elif not files:
            report("holozen record: nothing arrived, so no file is left; `holozen topic list` shows what is published")
        return 1 if failed or not files else 0

    def _figures(self) -> dict[str, object]:
        return {
            "seconds": round(time.monotonic() - self._begun, 1),
            "messages": self._writer.messages,
            "bytes": self._writer.size,
            "dropped": self._intake.dropped + self._recorder.refused,
            "left_out": sum(left.messages for left in self._recorder.left_out.values()),
            "lost": self._intake.lost,
            "overran": self._intake.overran,
        }

    def _line(self) -> str:
        figures = self._figures()
        text = f"{figures['seconds']} s, {figures['messages']} messages, {self._writer.size / 1e6:.2f} MB"
        text += f", {figures['dropped']} dropped" if figures["dropped"] else ", none dropped"
        text += f", {figures['lost']} lost on the way" if figures["lost"] else ""
        return text + (f", queue overrun {figures['overran']} times" if figures["overran"] else "")


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("keys", nargs="*", type=key, metavar="KEY", help="a key or key expression, such as */odom")
    add("-a", "--all", action="store_true", help="every key")
    add("-o", "--output", metavar="NAME", help="write NAME.mcap (default: holozen_DATE-TIME.mcap)")
    add("--max-size", type=number(0.1, 1e6, "MB"), metavar="MB",
        help="start a new file when one has this size: NAME_0.mcap, NAME_1.mcap, ...")  # fmt: skip
    add("--max-duration", type=number(0.1, 1e9, "s"), metavar="S", help="stop after S seconds")
    add("--use-sim-time", action="store_true", help="use the times of the sim's clock, which are those of the stamps")
    add("--ros2", action="store_true", help="write the folder NAME as `ros2 bag record` does, for `ros2 bag play`")


ABOUT = (
    "Record the messages of keys into an MCAP file, until Ctrl-C. It needs 8 MB of free disk space, reserved to finish"
    " the file on a full disk."
)
VERBS = by_name(
    *(Verb(name, ABOUT, "odom cmd_vel -o square", _arguments, run, "the figures as one JSON object a line")
    for name in ("record", "bag record"))
)  # fmt: skip
