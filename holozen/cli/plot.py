"""`holozen plot`: numbers of live messages, as lines in the terminal."""

import argparse
import json
import sys
import threading
import time
from collections import deque
from typing import Any

from holozen import connection
from holozen.bus import Bus
from holozen.cli.fields import path, pick
from holozen.cli.noun import Verb, add_packages
from holozen.cli.reading import Reader
from holozen.flags import Parser, number
from holozen.process import stop_event
from holozen.tap import Tap
from holozen.tell import printable, say

Field = tuple[str, str, tuple[str | int, ...]]
"""A field as it was written, its key, and the path in the messages there."""

ABOUT = "draw numbers of live messages in the terminal, until Ctrl-C"
EXAMPLE = "odom.twist.twist.linear.x cmd_vel.linear.x"
MOST = 5000  # points of a line
TICK = 0.02  # s between two looks at what came


def parser() -> argparse.ArgumentParser:
    parser = Parser(prog="holozen plot", description=ABOUT, epilog=f"example: holozen plot {EXAMPLE}")
    arguments(parser)
    parser.set_defaults(node="plot")
    parser.add_argument("--json", action="store_true", help="the numbers as they come, one JSON object a line")
    connection.add_arguments(parser)
    return parser


def arguments(parser: argparse.ArgumentParser) -> None:
    """The flags of `holozen plot`, which are those of `holozen topic plot` too."""
    parser.add_argument("fields", nargs="+", type=_field, metavar="KEY.FIELD", help="such as joint_states.position[0]")
    parser.add_argument(
        "-w", "--window", type=number(0.1, 3600, "s"), default=10.0, metavar="S", help="seconds shown (default: 10)"
    )
    parser.add_argument(
        "--once", action="store_true", help="watch for one window, print one picture (or its numbers) and end"
    )
    add_packages(parser)
    parser.add_argument("--ascii", action="store_true", help="without braille")


def _field(text: str) -> "Field":
    start = text.rpartition("/")[2]
    name, _, rest = start.partition(".")
    key = text[: len(text) - len(start)] + name
    if not (name and rest):
        raise argparse.ArgumentTypeError(f"{text!r}: write KEY.FIELD, such as odom.twist.twist.linear.x")
    try:
        return text, key.removeprefix("/"), path(rest)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def main(argv: list[str]) -> int:
    return plot(parser().parse_args(argv))


def plot(args: argparse.Namespace) -> int:
    """Draw, or print as JSON, what comes on the fields of `args`, until interrupted."""
    stop = stop_event()
    with Bus("plot", connection.from_arguments(args), patience=3.0, stop=stop) as bus:
        lines = Lines(bus, args.fields, Reader(packages=args.package))
        try:
            (_json if args.json else _draw)(lines, args, stop)
        except LookupError as error:
            say(f"{_named(args)}: {error.args[0]}")
            return 1
    if lines.bad:
        print(f"{lines.bad} messages could not be read", file=sys.stderr)
    if not any(lines.points.values()):
        say(f"{_named(args)}: nothing came; `holozen topic list` shows who publishes")
        return 1
    return 0


def _named(args: argparse.Namespace) -> str:
    return f"holozen {args.node.replace('_', ' ')}"


class Lines:
    """The points of each field, as they come."""

    def __init__(self, bus: Bus, fields: list[Field], reader: Reader) -> None:
        self.points: dict[str, deque[tuple[float, float]]] = {name: deque(maxlen=MOST) for name, _, _ in fields}
        self.bad = 0  # messages that nobody can read
        self._fields, self._bus, self._reader = fields, bus, reader
        self._taps: dict[str, Tap] = {}
        for key in dict.fromkeys(key for _, key, _ in fields):
            self._taps[key] = bus.tap(key)
            self._taps[key].ends.append(bus.announce("sub", "any/msg/Any", key))

    def take(self) -> list[dict[str, float]]:
        """Take in what waits, and return it. Raises LookupError for a field that is not there."""
        rows = []
        for key, tap in self._taps.items():
            while (sample := tap.try_recv()) is not None:
                value = self._reader.read(sample, self._bus)
                if isinstance(value, dict | list):
                    rows.append(self._add(key, value))
                else:
                    self.bad += 1
        return rows

    def _add(self, key: str, value: Any) -> dict[str, float]:
        row = {}
        for name, its, place in self._fields:
            if its == key:
                try:
                    row[name] = _number(pick(value, place))
                except LookupError as error:
                    raise LookupError(f"{name}: {error.args[0]}") from None
                self.points[name].append((time.monotonic(), row[name]))
        return row


def _number(value: Any) -> float:
    if isinstance(value, bool | int | float):
        return float(value)
    inside = f", it has {', '.join(map(str, value))}" if isinstance(value, dict) else ""
    raise LookupError(f"this is no number{inside}")


def _json(lines: Lines, args: argparse.Namespace, stop: threading.Event) -> None:
    end = time.monotonic() + args.window if args.once else float("inf")
    while time.monotonic() < end and not stop.wait(TICK):
        for row in lines.take():
            print(json.dumps({"time": round(time.time(), 4)} | row), flush=True)


def _draw(lines: Lines, args: argparse.Namespace, stop: threading.Event) -> None:
    from holozen.chart import panels
    from holozen.cli.screen import Screen

    begun = time.monotonic()
    picture: list[str] = []
    with Screen(args.once, args.ascii) as screen:
        due = begun + (args.window if args.once else 0.0)
        while not stop.wait(TICK):
            lines.take()
            if (now := time.monotonic()) < due:
                continue
            due = now + screen.every
            picture = [printable(line) for line in panels(lines.points, now, args.window, screen.size, screen.ascii)]
            if args.once:
                break
            screen.show(picture)
    if args.once:
        print("\n".join(line.rstrip() for line in picture), flush=True)


VERBS = {"plot": Verb(ABOUT, f"holozen topic plot {EXAMPLE}", arguments, plot)}
