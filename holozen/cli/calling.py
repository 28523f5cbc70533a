"""What `holozen service call` does: ask a service and print its reply."""

import json
import time

from holozen import wire
from holozen.bus import Bus
from holozen.cli import values
from holozen.cli.forms import TYPE
from holozen.cli.show import decode, lines
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
    row = wire.service(args.key)
    row = row or next((each for each in wire.SERVICES if given and each.reply.ROS.endswith(given)), None)
    if row and given and given.replace("/srv/", "/") != row.reply.ROS.replace("/srv/", "/"):
        say(f"holozen service call: {args.key}: its type is {row.reply.ROS}, not {given}")
        return 1
    if not (row or given or args.any):
        known = ", ".join(service.key for service in wire.SERVICES)
        say(f"holozen service call: {args.key!r} has no known type; known: {known}; give the type, or --any")
        return 1
    try:
        request = _payload(words[0] if words else "{}", row, given)
    except ValueError as error:
        say(f"holozen service call: {args.key}: refused: {error}")
        return 1
    _ask(bus, args, request)
    while args.rate:
        time.sleep(1 / args.rate)
        _ask(bus, args, request)
    return 0


def _payload(text: str, row: wire.Service | None, given: str) -> bytes:
    """The request as JSON, which every service reads; of a type if there is one. Raises ValueError."""
    from holozen import codec
    from holozen.cli import forms

    if row:
        return codec.encode(values.read_message(text, (row.request,)))
    if given:
        return forms.Foreign(f"{given}_Request", "json", force=False).payload(text)
    return json.dumps(values.plain(text)).encode()


def _ask(bus: Bus, args: "argparse.Namespace", request: bytes) -> None:
    from holozen.caller import call_bytes

    reply = call_bytes(bus, args.key, request, "application/json", args.timeout)
    value = decode(reply.payload, reply.encoding)
    print(json.dumps(value) if args.json else "\n".join([*lines(value), *(["---"] if args.rate else [])]), flush=True)
