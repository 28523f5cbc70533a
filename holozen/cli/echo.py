"""`holozen topic echo`: print what comes on a key, whoever wrote it."""

import sys

from holozen.cli.noun import Verb, add_packages, open_bus
from holozen.flags import count, key, number
from holozen.tap import Sample
from holozen.tell import printable, say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse
    from typing import Any

    from holozen.bus import Bus
    from holozen.cli.reading import Reader
    from holozen.tap import Tap

WAITING = 1.0  # s without anything until that is said


def echo(args: "argparse.Namespace") -> int:
    """Print every message of a key, until interrupted."""
    with open_bus(args, early=True) as bus:
        from holozen.cli.reading import Reader

        try:
            printer, reader = Printer(args), Reader(args.type_flag or args.type or "", args.package)
        except ValueError as error:
            say(f"holozen topic echo: {error}")
            return 2
        tap = bus.tap(args.key)
        tap.ends.append(bus.announce("sub", "any/msg/Any", args.key))
        return _echo(args, bus, tap, printer, reader)


def _echo(args: "argparse.Namespace", bus: "Bus", tap: "Tap", printer: "Printer", reader: "Reader") -> int:
    import threading
    from functools import partial

    from holozen.errors import BusError

    what = "nothing that passes the filter" if args.filter else "nothing"
    late = threading.Timer(
        args.timeout or WAITING, tap.close if args.timeout else partial(_wait, args, bus, what, printer)
    )
    late.daemon = True
    late.start()
    try:
        while True:
            try:
                sample = tap.recv()
            except BusError:
                told = f"{what} came on {args.key} within {args.timeout:g} s at {bus.where}"
                say(f"holozen topic echo: {told}{_meant(args, bus, printer)}")
                return 1
            if not args.filter:
                late.cancel()
            if printer.show(sample, reader.read(sample, bus)):
                late.cancel()
                if args.once:
                    return 0
    except LookupError as error:
        say(f"holozen topic echo: {args.key}: {error.args[0]}")
        return 1
    finally:
        printer.tell(reader.why)


def _wait(args: "argparse.Namespace", bus: "Bus", what: str, printer: "Printer") -> None:
    try:
        say(f"waiting for {args.key}; {what} came yet{_meant(args, bus, printer)}")
    except Exception:  # the session was closed meanwhile, which zenoh tells by an error of its own
        return


def _meant(args: "argparse.Namespace", bus: "Bus", printer: "Printer") -> str:
    from holozen.cli.near import meant

    if printer.stopped:
        from holozen.cli.filters import lacking

        return f"; {why}" if (why := lacking(args.filter, printer.stopped)) else ""
    return meant(bus, [args.key])


class Printer:
    """Prints values as the flags say, and counts what could not be shown. Raises ValueError for a wrong flag."""

    def __init__(self, args: "argparse.Namespace") -> None:
        self._args, self._many = args, "*" in args.key
        self._count = self._undecoded = self._fieldless = 0
        self._path = self._passes = None
        self.stopped: Any = None  # the last message that the filter did not let pass
        if args.field:
            from holozen.cli import fields

            self._path, self._pick = fields.path(args.field), fields.pick
        if args.filter:
            from holozen.cli import filters

            self._passes = filters.compiled(args.filter)
        self._short = args.truncate_length or args.no_arr or args.no_str

    def show(self, sample: Sample, value: "Any") -> bool:
        """Print one; whether it passed the filter and had the field. Raises LookupError for a field of no message."""
        from holozen.cli.show import Hex

        self._count += 1
        self._undecoded += isinstance(value, Hex)
        if self._passes and not self._passes(value):
            self.stopped = value
            return False
        if self._path:
            try:
                value = self._pick(value, self._path)
            except LookupError:
                if not self._many and not isinstance(value, Hex):
                    raise
                self._fieldless += 1
                return False
        if self._short:
            from holozen.cli.cut import cut

            value = cut(value, self._args.truncate_length, not self._args.no_arr, not self._args.no_str)
        self._write(sample, value)
        return True

    def _write(self, sample: Sample, value: "Any") -> None:
        if self._args.raw:
            return self._write_raw(sample.payload)
        if self._args.json:
            text = self._as_json(sample, value)
        elif self._args.csv:
            from holozen.cli.cut import row

            text = row([sample.key, value] if self._many else value)
        else:
            from holozen.cli.show import lines

            head = [printable(f"# {sample.key}")] if self._many else []
            text = "\n".join([*head, *lines(value, longest=0 if self._args.full_length else None), "---"])
        print(text, flush=True)
        return None

    def _as_json(self, sample: Sample, value: "Any") -> str:
        """One JSON object: the message, or what there is instead of one under `value` or `hex`."""
        import json

        from holozen.cli.show import Hex, strict

        # An object that came as one line of JSON is printed as it came.
        whole = not (self._many or self._path or self._short) and isinstance(value, dict)
        text = sample.payload.decode() if whole and sample.payload.startswith(b"{") and sample.payload.isascii() else ""
        if text and text.isprintable() and "NaN" not in text and "Infinity" not in text:
            return text
        if isinstance(value, Hex):
            found = {"hex": sample.payload.hex(), "size": sample.size, "encoding": sample.encoding}
        elif isinstance(value, dict) and not self._many:
            found = value
        else:
            found = {"value": value}
        return json.dumps(strict({"key": sample.key, **found} if self._many else found))

    def _write_raw(self, payload: bytes) -> None:
        """The bytes as they came; on a terminal only such that cannot harm it."""
        if sys.stdout.isatty():
            print(payload, flush=True)
        else:
            sys.stdout.buffer.write(payload if self._args.once else payload + b"\n")
            sys.stdout.buffer.flush()

    def tell(self, why: str) -> None:
        """Say what could not be shown, if there was any, and `why` the last of it could not."""
        if self._undecoded:
            last = "the last: " * (self._undecoded > 1)
            say(f"{self._undecoded} of {self._count} samples could not be decoded; {last}{why}")
        if self._fieldless:
            say(f"{self._fieldless} of {self._count} samples have no field {self._args.field}")


def _arguments(parser: "argparse.ArgumentParser") -> None:
    add = parser.add_argument
    add("key", type=key, help="a key or key expression, such as odom or */odom")
    add("type", nargs="?", metavar="TYPE", help="the same as --type")
    told = "the type of CDR payloads, where nobody tells it, such as geometry_msgs/msg/Twist"
    add("--type", dest="type_flag", metavar="TYPE", help=told)
    add_packages(parser)
    add("--once", action="store_true", help="end after the first message")
    add("--timeout", type=number(0.01, 1e6, "s"), metavar="S", help="exit code 1 after S seconds without any")
    add("--field", metavar="A.B", help="only this field, such as pose.pose.position or transforms[0].child_frame_id")
    add("--filter", metavar="EXPR", help="only messages of which this is true, such as 'm.linear.x > 0.2'")
    add("--csv", action="store_true", help="values with commas, a message a line")
    add("--raw", action="store_true", help="the bytes as they came; on a terminal, escaped")
    add("--no-arr", action="store_true", help="only the length of lists")
    add("--no-str", action="store_true", help="only the length of texts")
    told = "show at most N values of a list and characters of a text (default: 128 values of a list)"
    add("-l", "--truncate-length", type=count(1), default=0, metavar="N", help=told)
    add("-f", "--full-length", action="store_true", help="lists in full")


VERBS = {"echo": Verb("print what comes on a key", "holozen topic echo odom --once", _arguments, echo)}
