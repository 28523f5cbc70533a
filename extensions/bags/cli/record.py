"""`holozen record`: records the messages of keys into a bag."""

import argparse
import errno
import json
import re
import threading
import time
from collections.abc import Callable
from functools import lru_cache, partial
from typing import TYPE_CHECKING

from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, Line, printable, report
from holozen.flags import Instead, key, number, refused
from holozen.process import stop_event
from holozen.transport import connection

if TYPE_CHECKING:
    from holozen.bags.recorder import Intake, Recorder
    from holozen.bags.writer import BagWriter
    from holozen.transport.graph import Endpoint
    from holozen.transport.node import Node

FLUSH = 1.0  # s; a killed recorder loses at most what arrived since
IDLE = 0.01  # s between two looks at an empty queue
TAIL = 0.2  # s after Ctrl-C, in which Zenoh's threads read what had come in before it
SILENT = 2.0  # s until the keys on which nothing has arrived are reported, once
TOPICS = "; `holozen topic list` shows the topics"
REPORT_EVERY = {True: 0.5, False: 5.0}  # s between two lines, in a terminal and elsewhere


def run(args: argparse.Namespace) -> int:
    """Record until Ctrl-C, or until --max-duration has passed."""
    args.keys += args.topics
    given = [bool(args.keys), args.all, args.regex is not None]
    if sum(given) != 1:
        several = "give keys, -a or -e, only one of them"
        args.error(
            several
            if any(given)
            else "name the keys to record, or use -a for all, -e for those that match"
        )
    from holozen.bags.writer import BagWriter, RosBagWriter

    name = args.output or time.strftime("holozen_%Y_%m_%d-%H_%M_%S")
    stop = stop_event()
    try:
        limit = round((args.max_size or 0) * 1e6)
        writer = (
            RosBagWriter(name, limit)
            if args.ros2
            else BagWriter(name, limit, "ros2" if _for_ros(args) else "")
        )
    except OSError as error:
        raise Failure(
            f"cannot write {error.filename or name}: {error.strerror}{_fix(error)}"
        ) from None
    _record(args, writer, stop)
    return 0


def _for_ros(args: argparse.Namespace) -> bool:
    return bool(args.ros2) or args.wire == "cdr"


def _fix(error: OSError) -> str:
    if error.errno == errno.ENOSPC:
        return "; free some space, or choose a folder on another disk with -o"
    return "; choose another name with -o" if isinstance(error, FileExistsError) else ""


def _record(args: argparse.Namespace, writer: "BagWriter", stop: threading.Event) -> None:
    from holozen.bags import BagError
    from holozen.bags.recorder import DEPTH, Intake, Recorder, SimTime
    from holozen.bus import Bus
    from holozen.cli.hints import suggest_key

    failed = ""
    try:
        wanted = lru_cache(partial(_is_wanted, args))
        with (
            Bus("record", connection.from_arguments(args), stop=stop) as bus,
            Intake(wanted=wanted) as intake,
        ):
            for expression in _expressions(args):
                subscriber = bus.subscribe_raw(expression, DEPTH)
                subscriber.ends.append(bus.announce("sub", "any/msg/Any", expression))
                intake.listen(subscriber)
            what = (
                f"the keys that match {args.regex.pattern!r}"
                if args.regex
                else " ".join(args.keys) or "every key"
            )
            left_out = ([repr(args.exclude.pattern)] if args.exclude else []) + args.exclude_topics
            what += f" except {' '.join(left_out)}" if left_out else ""
            report(f"recording {what} into {writer.files[0]}; Ctrl-C ends it")
            sim_time = SimTime() if args.use_sim_time else None
            graph, latched = bus.graph(), Latched(bus, intake, _expressions(args))
            latched.take(bus.endpoints())
            recorder = Recorder(intake, writer, graph, _for_ros(args), sim_time, bus.definition)
            progress = Progress(
                args.json, args.keys, intake, recorder, writer, partial(suggest_key, bus)
            )
            try:
                _until(
                    stop,
                    args.max_duration,
                    recorder,
                    writer,
                    lambda: latched.take(graph.endpoints()),
                    progress,
                )
                if stop.is_set():  # a process that was held up finds Ctrl-C before its samples
                    _until(threading.Event(), TAIL, recorder, writer, lambda: None, progress)
                intake.close()
                while not writer.full and recorder.write_some():
                    pass
                writer.close()
            except BagError as error:
                writer.abandon()
                failed = str(error)
            progress.look()
    except BaseException:
        writer.close()
        raise
    progress.end(failed or writer.full)


class Latched:
    """Takes in the last message of each publisher of a latched key, once it appears."""

    def __init__(self, bus: "Node", intake: "Intake", expressions: list[str]) -> None:
        self._bus, self._intake, self._expressions = bus, intake, expressions
        self._asked: set[Endpoint] = set()

    def take(self, endpoints: "list[Endpoint]") -> None:
        """Ask the publishers among these endpoints that were not asked."""
        from holozen.transport.graph import latched

        found = {one for expression in self._expressions for one in latched(endpoints, expression)}
        for sample in self._bus.last_messages(sorted(found - self._asked)):
            self._intake.add_latched(sample)
        self._asked = found


def _until(
    stop: threading.Event,
    seconds: float | None,
    recorder: "Recorder",
    writer: "BagWriter",
    look: Callable[[], None],
    progress: "Progress",
) -> None:
    """Write until `stop` is set, `seconds` have passed or the disk is full; `look` is called with
    each flush.
    """
    begun = flushed = time.monotonic()
    while not (stop.is_set() or writer.full):
        now = time.monotonic()
        if seconds is not None and now - begun >= seconds:
            return
        if not recorder.write_some():
            stop.wait(IDLE)
        if now - flushed >= FLUSH:
            writer.flush()
            look()
            flushed = now
        progress.report(now)


def _expressions(args: argparse.Namespace) -> list[str]:
    """The key expressions to subscribe to; those included in another are dropped, so that nothing
    is recorded twice.
    """
    from holozen.transport.graph import includes

    different = list(
        dict.fromkeys(
            [*args.keys, *(["clock"] if args.use_sim_time else [])] if args.keys else ["**"]
        )
    )
    return [
        one
        for one in different
        if not any(other != one and includes(other, one) for other in different)
    ]


def _is_wanted(args: argparse.Namespace, name: str) -> bool:
    """Whether -e, -x and --exclude-topics leave a key in."""
    from holozen.transport.graph import includes

    if args.use_sim_time and name == "clock":
        return True
    return (
        (args.regex is None or _matches(args.regex, name))
        and not (args.exclude and _matches(args.exclude, name))
        and not any(includes(one, name) for one in args.exclude_topics)
    )


def _matches(regex: "re.Pattern[str]", name: str) -> bool:
    """Whether a key matches as it is, or as the topic of ROS, which begins with a slash."""
    return bool(regex.search(name) or regex.search(f"/{name}"))


def _regex(text: str) -> "re.Pattern[str]":
    try:
        return re.compile(text)
    except re.error as error:
        raise refused(
            f"{text!r} is not a regular expression: {error}; write one such as 'odom|tf'"
        ) from None


class Progress:
    """Reports progress: in a terminal on one line that is rewritten, elsewhere on a new line from
    time to time.
    """

    def __init__(
        self,
        as_json: bool,
        wanted: list[str],
        intake: "Intake",
        recorder: "Recorder",
        writer: "BagWriter",
        suggest: Callable[[list[str]], str],
    ) -> None:
        self._wanted, self._suggest = wanted, suggest
        # at the last look: the keys, and which are meant
        self._missing: tuple[str, str] | None = None
        self._json, self._intake, self._recorder, self._writer = as_json, intake, recorder, writer
        self._over = Line(hidden=as_json)
        self._begun = self._reported = time.monotonic()

    def report(self, now: float) -> None:
        """Report progress, unless the last report is too recent."""
        if self._missing is None and now - self._begun >= SILENT and (silent := self.look()):
            self._over.show("")
            report(f"nothing has arrived on {silent}")
        if now - self._reported < (1.0 if self._json else REPORT_EVERY[self._over.shown]):
            return
        self._reported = now
        if self._json:
            print(json.dumps(self._figures()), flush=True)
        elif self._over.shown:
            self._over.show(self._line())
        else:
            report(self._line())

    def look(self) -> str:
        """Look for the keys on which nothing has arrived, while the bus is open; returns them with
        those meant.
        """
        silent = self._silent()
        self._missing = ", ".join(silent), (self._suggest(silent) if silent else "") or TOPICS
        return "".join(self._missing) if silent else ""

    def end(self, failed: str) -> None:
        """Report the result. Raises Failure if the recording `failed` for a reason, or is empty."""
        silent, near = self._missing or ("", TOPICS)
        files = [str(path) for path in self._writer.files]
        self._over.show("")
        if self._json:
            print(json.dumps(self._figures() | {"files": files, "error": failed}), flush=True)
        elif files:
            print(printable(f"{', '.join(files)}: {self._line()}"), flush=True)
        for name, (count, why) in self._recorder.left_out.items():
            report(f"holozen record: left out {count} messages of {name}: {why}")
        if failed:
            raise Failure(
                f"stopped: {failed}{'; everything written before can be read' if files else ''}"
            )
        if not files and self._recorder.early:
            raise Failure("no file is kept: nothing arrived on clock, so the sim's time is unknown")
        if not files and self._recorder.left_out:
            raise Failure("no file is kept: a bag for ROS 2 can hold none of these messages")
        if not files:
            raise Failure(f"no messages arrived, so no file is kept{near}")
        if silent:
            report(f"holozen record: nothing arrived on {silent}{near}")

    def _silent(self) -> list[str]:
        """The keys and key expressions that were asked for and brought nothing."""
        from holozen.transport.graph import includes

        keys = tuple(self._intake.keys)  # which other threads add to
        return [one for one in self._wanted if not any(includes(one, key) for key in keys)]

    def _figures(self) -> dict[str, object]:
        return {
            "seconds": round(time.monotonic() - self._begun, 1),
            "messages": self._writer.messages,
            "bytes": self._writer.size,
            "dropped": self._intake.dropped + self._recorder.refused,
            "left_out": sum(left.messages for left in self._recorder.left_out.values()),
            "lost": self._intake.lost,
            "overran": self._intake.overran,
            "deletions": self._intake.deletions,
        }

    def _line(self) -> str:
        figures = self._figures()
        text = (
            f"{figures['seconds']} s, {figures['messages']} messages, "
            f"{self._writer.size / 1e6:.2f} MB"
        )
        text += f", {figures['dropped']} dropped" if figures["dropped"] else ", none dropped"
        text += f", {figures['lost']} lost on the way" if figures["lost"] else ""
        text += f", {figures['deletions']} deletions left out" if figures["deletions"] else ""
        return text + (f", queue overrun {figures['overran']} times" if figures["overran"] else "")


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("keys", nargs="*", type=key, metavar="KEY", help="a key or key expression, such as */odom")
    add(
        "--topics",
        nargs="+",
        type=key,
        default=[],
        metavar="KEY",
        help="more of them, as for ros2 bag record",
    )
    add("-a", "--all", "--all-topics", action="store_true", help="every key")
    add(
        "-e",
        "--regex",
        type=_regex,
        metavar="REGEX",
        help="the keys in which this regular expression matches",
    )
    add(
        "-x",
        "--exclude-regex",
        "--exclude",
        dest="exclude",
        type=_regex,
        metavar="REGEX",
        help="leave out the keys in which it matches",
    )
    add("--exclude-topics", nargs="+", type=key, default=[], metavar="KEY", help="leave out these")
    add("-o", "--output", metavar="NAME", help="write NAME.mcap (default: holozen_DATE-TIME.mcap)")
    add(
        "--max-size",
        type=number(0.1, 1e6, "MB"),
        metavar="MB",
        help="start a new file when one has this size: NAME_0.mcap, NAME_1.mcap, ...",
    )
    add("--max-duration", type=number(0.1, 1e9, "s"), metavar="S", help="stop after S seconds")
    split = "--max-size MB starts a new file at that size, --max-duration S ends the recording"
    for name in ("-b", "--max-bag-size", "-d", "--max-bag-duration"):
        add(name, action=Instead, advice=split)
    add(
        "--use-sim-time",
        action="store_true",
        help="use the times of the sim's clock, which are those of the stamps",
    )
    add(
        "--ros2",
        action="store_true",
        help="write the folder NAME as `ros2 bag record` does, for `ros2 bag play`",
    )


ABOUT = "record the messages of keys into an MCAP file, until Ctrl-C"
NOTES = "It needs 8 MB of free disk space, reserved to finish the file on a full disk."
VERBS = by_name(
    *(
        Verb(
            name,
            ABOUT,
            "odom cmd_vel -o square",
            _arguments,
            run,
            "print the figures as JSON, one object per line",
            NOTES,
        )
        for name in ("record", "bag record")
    )
)
