"""`holozen replay`: publish the messages of a bag again, at their times."""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from holozen.bus import Bus
from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, Line, printable, report
from holozen.flags import Instead, key, number, path, refused
from holozen.process import stop_event
from holozen.suggest import shorten
from holozen.transport import connection
from holozen.wire import VELOCITIES

if TYPE_CHECKING:
    from pathlib import Path

    from holozen.bags import Channel, Message
    from holozen.bags.player import Outlet, Plan, Player
    from holozen.bags.reader import Summary
    from holozen.command.feedback import CommandFeedback

WAIT = ("transport/link/tx/queue/congestion_control/drop/wait_before_drop", "20000")  # microseconds
AGAIN = 0.02  # s between two rounds of a loop, so that a very short bag does not flood the bus
SHOW_EVERY = 0.2  # s between two updates of the line in a terminal


def run(args: argparse.Namespace) -> int:
    """Play files, one after the other."""
    from holozen.bags.player import Outlet, Player, keys, plan
    from holozen.bags.reader import Bag, summarize
    from holozen.cli.publish import command_feedback
    from holozen.transport.denied import denied

    olds = [old for old, _ in args.remap]
    if twice := next((old for old in olds if olds.count(old) > 1), ""):
        args.error(f"--remap: {twice!r} is given twice; it is played on one key")
    if args.start_paused and not sys.stdin.isatty():
        args.error("--start-paused needs a terminal, in which space goes on")
    stop, summaries = stop_event(), []
    for file in args.files:
        with Bag(file) as bag:
            summaries.append(summarize(bag))
    channels = {channel for summary in summaries for channel in summary.streams}
    wire = connection.from_arguments(args)
    # Zenoh drops a sample after a millisecond in a full queue; samples of a bag may wait longer.
    wire = wire._replace(cfg=(WAIT, *wire.cfg))
    with Bus("replay", wire, stop=stop) as bus:
        others = [endpoint for endpoint in bus.endpoints() if endpoint.session != bus.id]
        made = plan(
            channels, others, topics=args.topics, remap=dict(args.remap), commands=args.commands
        )
        for name, why in made.left_out.items():
            report(f"{shorten(name)} is left out: {why}")
        if not made.targets:
            raise Failure(f"nothing was played{_advice(made)}")
        outlet = Outlet(bus, made)
        dropped = denied(bus, wire, made.targets.values())
        for key, why in dropped.items():
            report(why)
            outlet.leave_out(key)
        wanted = {channel for channel, target in made.targets.items() if target not in dropped}
        if not wanted:
            raise Failure("nothing was played: nobody would hear it")
        outlet.settle()
        with keys(stop) as pressed:
            player = Player(
                outlet.publish,
                outlet.stop,
                pressed,
                stop,
                args.rate,
                _report_gap,
                args.start_paused,
            )
            feedback = [command_feedback(bus, f"{target}_status") for target in _velocities(made)]
            stop.wait(args.delay)
            return _play(args, summaries, player, outlet, wanted, feedback) or int(bool(dropped))


def _report_gap(seconds: float) -> None:
    report(f"replay did not run for {seconds:.1f} s; it goes on from where it was")


def _advice(made: "Plan") -> str:
    """Advice for a plan that plays nothing."""
    if made.published:
        nodes = " and ".join(sorted(set(made.published.values())))
        key = "odom" if "odom" in made.published else min(made.published)
        return f"; end {nodes} first, or play under other keys, such as --remap {key}:=old/{key}"
    return (
        "; --commands plays what moves robots" if made.left_out else ": the bag holds no messages"
    )


def _velocities(made: "Plan") -> list[str]:
    """The keys on which commands of a velocity are played."""
    played = (
        {target for channel, target in made.targets.items() if channel.type in VELOCITIES}
        if made.moves
        else set()
    )
    return sorted(played & made.commands.keys())


def _play(
    args: argparse.Namespace,
    summaries: list["Summary"],
    player: "Player",
    outlet: "Outlet",
    wanted: "set[Channel]",
    feedback: list["CommandFeedback"],
) -> int:
    def look(now: float) -> None:
        line.update(now)
        for each in feedback:
            each.look()

    start = min((summary.start for summary in summaries if summary.count), default=0)
    first = start + round(args.start_offset * 1e9)
    last = start + round(args.until * 1e9) if args.until is not None else 2**64
    line = _Position(player, start, max(summary.end for summary in summaries))
    begun = time.monotonic()
    try:
        while True:
            before = player.count
            ended = player.play(_messages(args.files, wanted, first, last), look)
            if not (args.loop and ended and player.count > before):
                break
            time.sleep(AGAIN)
    finally:
        outlet.stop()
        line.clear()
        for key in sorted(outlet.goals):
            report(
                f"{key}: the robot may drive on to the last goal, since its controller drives it"
            )
    seconds = time.monotonic() - begun
    if args.json:
        print(json.dumps({"messages": player.count, "seconds": round(seconds, 3)}))
    else:
        print(
            printable(
                f"played {player.count} message{'s' * (player.count != 1)} in {seconds:.1f} s"
            )
        )
    if ended and not player.count:
        raise Failure(
            "nothing was played"
            if outlet.left_out
            else "no message is between --start-offset and --until"
        )
    for each in feedback:
        each.told()
    return int(any(each.refusal for each in feedback))


def _messages(
    files: "list[Path]", wanted: "set[Channel]", first: int, last: int
) -> Iterator["Message"]:
    from holozen.bags.reader import Bag

    for file in files:
        with Bag(file) as bag:
            yield from (m for m in bag.messages() if m.channel in wanted and first <= m.at <= last)


class _Position:
    """The position in the bag, on one line that is rewritten. Only a terminal shows it."""

    def __init__(self, player: "Player", start: int, end: int) -> None:
        self._player, self._start, self._end = player, start, end
        self._line, self._shown = Line(), 0.0

    def update(self, now: float) -> None:
        """Show the position, at most every SHOW_EVERY seconds."""
        if not self._line.shown or now - self._shown < SHOW_EVERY:
            return
        self._shown = now
        at = max(0, self._player.position - self._start) / 1e9
        state = (
            "paused: space resumes, the right arrow steps"
            if self._player.paused
            else "space pauses"
        )
        text = (
            f"{at:.2f} / {(self._end - self._start) / 1e9:.2f} s, {self._player.count} "
            f"messages; {state}"
        )
        self._line.show(text)

    def clear(self) -> None:
        """Leave an empty line."""
        self._line.show("")


def _remap(text: str) -> tuple[str, str]:
    old, sign, new = text.partition(":=")
    if not (old and sign and new):
        raise refused(f"{text!r}: write OLD:=NEW, such as odom:=old/odom")
    return key(old), key(new)


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("files", nargs="+", type=path, metavar="FILE", help="played one after the other")
    add(
        "-r",
        "--rate",
        type=number(0.001, 1e6),
        default=1.0,
        metavar="X",
        help="times as fast (default: 1)",
    )
    add("-l", "--loop", action="store_true", help="start again at the end, until Ctrl-C")
    add(
        "--start-offset",
        type=number(0, 1e9, "s"),
        default=0.0,
        metavar="S",
        help="start S seconds into the bag",
    )
    add(
        "--until",
        type=number(0, 1e9, "s"),
        metavar="S",
        help="stop S seconds after the start of the bag",
    )
    add("--topics", nargs="+", type=key, metavar="KEY", help="only these keys or key expressions")
    add(
        "-m",
        "--remap",
        nargs="+",
        type=_remap,
        default=[],
        metavar="OLD:=NEW",
        help="play on another key",
    )
    add(
        "-d",
        "--delay",
        type=number(0, 1e6, "s"),
        default=0.0,
        metavar="S",
        help="wait S seconds before the first message",
    )
    add(
        "-p",
        "--start-paused",
        action="store_true",
        help="begin with a pause, which space ends in a terminal",
    )
    add(
        "--clock",
        action=Instead,
        advice="a bag that has the key clock plays it: `holozen record -a` records it too",
    )
    add(
        "--commands",
        action="store_true",
        help="also play keys that move robots; they are stopped at the end, but not on the way to "
        "a goal",
    )


ABOUT = "publish the messages of MCAP files again, at their times"
NOTES = (
    "Keys that move robots are left out unless"
    " --commands is given, and so are keys that have a publisher now (see --remap). In a "
    "terminal, space pauses and"
    " resumes, and during a pause the right arrow (or s) plays the next message. Payloads are "
    "unchanged, but"
    " for the stamps of commands, which become the time of playing."
)
VERBS = by_name(
    *(
        Verb(
            name,
            ABOUT,
            "square.mcap --remap odom:=old/odom -r 2",
            _arguments,
            run,
            "print the figures as JSON at the end, one object per line",
            NOTES,
        )
        for name in ("replay", "bag play")
    )
)
