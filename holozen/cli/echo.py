"""`holozen topic echo`: print the messages of a key."""

from __future__ import annotations

import argparse
import json
import sys
import threading
from collections import deque
from functools import partial
from typing import Any

from holozen.cli.hints import is_any, suggest_key
from holozen.console import Failure, printable, report
from holozen.output import Hex, SampleReader, csv_row, cut, lines, strict
from holozen.transport.errors import BusError
from holozen.transport.graph import is_latched, latched, on_key
from holozen.transport.node import Node
from holozen.transport.samples import RawSubscriber, Sample

DEPTH = 1024  # messages that wait to be printed
EXCLUSIVE = (
    ("json", "csv"),
    ("json", "raw"),
    ("csv", "raw"),
    ("field", "raw"),
    ("full_length", "truncate_length"),
)
"""Flags of which one has no effect beside the other."""
WAITING = 1.0  # s without a message until that is reported


def echo(args: argparse.Namespace, bus: Node) -> int:
    """Print every message of a key, until interrupted."""
    for one, other in EXCLUSIVE:
        if getattr(args, one) and getattr(args, other):
            args.error(f"give --{one} or --{other}, not both".replace("_", "-"))
    try:
        printer, reader = (
            Printer(args),
            SampleReader(args.type_flag or args.type or "", args.package),
        )
    except ValueError as error:
        args.error(str(error))
    subscriber = bus.subscribe_raw(args.key, DEPTH)
    subscriber.ends.append(bus.announce("sub", "any/msg/Any", args.key))
    return _echo(args, bus, subscriber, printer, reader)


def _latched(args: argparse.Namespace, bus: Node, subscriber: RawSubscriber) -> deque[Sample]:
    """The last messages of latched keys, as the QoS says, and after them those that arrived
    meanwhile.
    """
    every = args.qos_durability == "transient_local"
    last = args.key.rpartition("/")[2]
    if args.qos_durability == "volatile" or not (every or "*" in last or is_latched(last)):
        return deque()
    kept = [*bus.last_messages(latched(bus.endpoints(), args.key, every))]
    came = [sample for _ in range(DEPTH) if (sample := subscriber.try_recv())]
    known = {(sample.key, sample.payload) for sample in came}
    return deque([sample for sample in kept if (sample.key, sample.payload) not in known] + came)


def _echo(
    args: argparse.Namespace,
    bus: Node,
    subscriber: RawSubscriber,
    printer: Printer,
    reader: SampleReader,
) -> int:
    first, seen = _latched(args, bus, subscriber), set[str]()
    nothing = "no message that passes the filter" if args.filter else "no messages"
    then = (
        subscriber.close if args.timeout else partial(_report_waiting, args, bus, nothing, printer)
    )
    late = threading.Timer(args.timeout or WAITING, then)
    late.daemon = True
    late.start()
    try:
        while True:
            try:
                sample = first.popleft() if first else subscriber.recv()
            except BusError:
                why = f"{nothing} on {args.key} within {args.timeout:g} s"
                raise Failure(f"{why}{_hint(args, bus, printer)}") from None
            if not (args.filter or sample.is_deletion):
                late.cancel()
            if reader.given and sample.key not in seen:
                seen.add(sample.key)
                _check_type(reader.given, sample.key, bus)
            if printer.show(sample, reader.read(sample, bus)):
                late.cancel()
                if args.once:
                    return 0
    except LookupError as error:
        raise Failure(f"{args.key}: {error.args[0]}") from None
    finally:
        printer.report_skipped(reader.why)


def _check_type(given: str, key: str, bus: Node) -> None:
    """Raise Failure if all publishers of a key announce another type than the given one."""
    found = {
        end.type for end in on_key(bus.endpoints(), key, "pub") if end.type and not is_any(end)
    }
    if found and given not in found:
        raise Failure(
            f"{key}: its type is {' or '.join(sorted(found))}, not {given}; leave the type out"
        )


def _report_waiting(args: argparse.Namespace, bus: Node, nothing: str, printer: Printer) -> None:
    try:
        report(f"waiting for {args.key}; {nothing} yet{_hint(args, bus, printer)}")
    # the session was closed in the meantime, for which zenoh raises an error of its own
    except Exception:
        return


def _hint(args: argparse.Namespace, bus: Node, printer: Printer) -> str:
    if printer.filter and printer.stopped:
        return f"; {why}" if (why := printer.filter.lacking(printer.stopped)) else ""
    return suggest_key(bus, [args.key])


class Printer:
    """Prints values as the flags say, and counts those it cannot show. Raises ValueError for an
    invalid flag.
    """

    def __init__(self, args: argparse.Namespace) -> None:
        self._args, self._many = args, "*" in args.key
        self._count = self._undecoded = self._fieldless = 0
        self._path = self.filter = None
        self.stopped: Any = None  # the last message that the filter rejected
        if args.field or args.filter:
            from holozen import fields

            self._pick = fields.pick
            self._path = fields.path(args.field) if args.field else None
            self.filter = fields.Filter(args.filter) if args.filter else None
        self._short = args.truncate_length or args.no_arr or args.no_str

    def show(self, sample: Sample, value: Any) -> bool:
        """Print a value; returns whether it was shown. Raises LookupError if the field is
        missing.
        """
        if sample.is_deletion:  # it holds no message, so no filter passes it and it has no field
            if not (self.filter or self._path):
                self._write(sample, {"deleted": True} if self._args.json else "(deleted)")
            return not (self.filter or self._path)
        self._count += 1
        self._undecoded += isinstance(value, Hex)
        if self.filter and not self.filter.passes(value):
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
            value = cut(
                value, self._args.truncate_length, not self._args.no_arr, not self._args.no_str
            )
        self._write(sample, value)
        return True

    def _write(self, sample: Sample, value: Any) -> None:
        if self._args.raw:
            return self._write_raw(sample.payload)
        if self._args.json:
            text = self._as_json(sample, value)
        elif self._args.csv:
            text = csv_row([sample.key, value] if self._many else value)
        else:
            head = [printable(f"# {sample.key}")] if self._many else []
            text = "\n".join(
                [*head, *lines(value, longest=0 if self._args.full_length else None), "---"]
            )
        print(text, flush=True)
        return None

    def _as_json(self, sample: Sample, value: Any) -> str:
        """One JSON object: the message, or anything that is not one under `value` or `hex`."""
        # An object received as one line of JSON is printed unchanged.
        whole = not (self._many or self._path or self._short) and isinstance(value, dict)
        text = (
            sample.payload.decode()
            if whole and sample.payload.startswith(b"{") and sample.payload.isascii()
            else ""
        )
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
        """The bytes as received; escaped on a terminal, which control sequences could harm."""
        if sys.stdout.isatty():
            print(payload, flush=True)
        else:
            sys.stdout.buffer.write(payload if self._args.once else payload + b"\n")
            sys.stdout.buffer.flush()

    def report_skipped(self, why: str) -> None:
        """Report how many samples could not be shown, if any, and `why` the last one could not."""
        verb, of_all = f"holozen {self._args.verb}", f"of {self._count} samples"
        if self._undecoded:
            last = "the last: " * (self._undecoded > 1)
            report(f"{verb}: {self._undecoded} {of_all} could not be decoded; {last}{why}")
        if self._fieldless:
            report(f"{verb}: {self._fieldless} {of_all} have no field {self._args.field}")
