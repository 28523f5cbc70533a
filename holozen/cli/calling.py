"""What `holozen service call` does: ask a service and print its reply."""

import json
import time

from holozen.bus import Bus
from holozen.cli import request
from holozen.cli.forms import TYPE
from holozen.cli.reading import CDR, Reader
from holozen.cli.show import Hex, lines
from holozen.errors import NoReply
from holozen.tell import say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse


def call(bus: Bus, args: "argparse.Namespace") -> int:
    """Send a request and print the reply; the exit code."""
    words = list(args.words)
    given = words.pop(0) if words and TYPE.fullmatch(words[0]) else ""
    if len(words) > 1:
        say(f"holozen service call: {args.key}: {words[-1]!r} is too much; write KEY [TYPE] REQUEST")
        return 2
    try:
        payload, kind = request.written(bus, args, words[0] if words else "{}", given)
    except ValueError as error:
        say(f"holozen service call: {error}")
        return 1
    reader = Reader(packages=args.package)
    try:
        _ask(bus, args, payload, reader, kind)
        while args.rate:
            time.sleep(1 / args.rate)
            _ask(bus, args, payload, reader, kind)
    except NoReply as error:
        from holozen.cli.near import meant

        raise NoReply(f"{error}{meant(bus, [args.key], ('srv',))}") from None
    return 0


def _ask(bus: Bus, args: "argparse.Namespace", payload: bytes, reader: Reader, kind: str) -> None:
    from holozen.caller import call_bytes

    reply = call_bytes(bus, args.key, payload, "application/json", args.timeout)
    if kind and reply.encoding == CDR:  # it does not say of which type
        reply.encoding = f"{CDR};{kind}_Response"
    value = reader.read(reply, bus)
    print(json.dumps(value) if args.json else "\n".join([*lines(value), *(["---"] if args.rate else [])]), flush=True)
    if isinstance(value, Hex):
        say(f"holozen service call: {args.key}: the reply could not be decoded: {reader.why}")
