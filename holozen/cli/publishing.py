"""What `holozen topic pub` does: write checked messages to a key, and see that they arrive."""

import contextlib
import json
import sys
import time

from holozen import wire
from holozen.bus import Bus
from holozen.cli import forms, values
from holozen.cli.forms import Form, Ours
from holozen.cli.obeyed import Watcher
from holozen.cli.pub import EXAMPLE, PATIENCE
from holozen.graph import Endpoint, on_key
from holozen.messages import Message
from holozen.process import stop_event
from holozen.publisher import Publisher
from holozen.tell import say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse
    import threading
    from collections.abc import Callable, Iterator

STOPS, STOP_EVERY = 5, 0.02  # s
LOOK = 0.1  # s between two looks at standard input's lines and at who is obeyed


class Refused(Exception):
    """What is wrong, in one line, and the exit code."""

    def __init__(self, text: str, code: int = 1) -> None:
        super().__init__(text)
        self.code = code


def publish(bus: Bus, args: "argparse.Namespace", looking: "Callable[[], list[Endpoint]]") -> int:
    """Publish as the flags say. `looking` waits for the end of a first look at the graph, and gives what it found."""
    if set(args.key) & set("*$?#"):
        say(f"holozen topic pub: {args.key!r}: write to one key; a wildcard would move every robot")
        return 1
    try:
        form = _form(args)
        payload = _payload(form, args) if form else None
        _ = bus.session  # once it is open: Ctrl-C ends the wait for a router as well
        stop = stop_event()
        form = form or _form_of_listener(looking(), args)
        return _run(bus, args, form, payload or _payload(form, args), stop, looking)
    except Refused as error:
        say(f"holozen topic pub: {error}")
        return error.code


def _run(
    bus: Bus,
    args: "argparse.Namespace",
    form: Form,
    payload: bytes,
    stop: "threading.Event",
    looking: "Callable[[], list[Endpoint]]",
) -> int:
    publisher: Publisher[Message] = bus.publisher(args.key, form.kind)
    matched = 0 if args.no_wait else _matched(bus, publisher, args, stop, looking)
    if not args.no_wait:
        say(
            f"{matched} subscriber{'s' * (matched != 1)} of {args.key}"
            if matched
            else f"nobody subscribes to {args.key}"
        )
        if not matched and (args.once or args.times):
            return 1
        if args.wait and matched < args.wait and not stop.is_set():
            raise Refused(f"{args.key}: {args.wait} subscribers did not come in time, so nothing is published")
    watcher = Watcher(bus, args.key) if form.stop() else None
    if watcher and matched:
        watcher.ask()
    turns = _lines(form, args, stop) if args.stdin else _turns(form, payload, args, stop)
    sent = 0
    try:
        for each in turns:
            publisher.put_bytes(each)
            sent += 1
            if watcher:
                watcher.look()
    finally:
        stopping = form.stop()
        if stopping and not args.once:
            _stop_robot(publisher, stopping)
    if args.json:
        print(json.dumps({"key": args.key, "type": form.kind.ROS, "subscribers": matched, "published": sent}))
    return 0


def _form(args: "argparse.Namespace") -> Form | None:
    """What is written: of the type given, else of the table's row; None if only who reads the key can tell."""
    words = list(args.words)
    given = words.pop(0) if words and forms.TYPE.fullmatch(words[0]) else ""
    if len(words) > 1 or (args.stdin and words):
        raise Refused(f"{args.key}: {words[-1]!r} is too much; write KEY [TYPE] VALUE", 2)
    if not (words or given or args.stdin):
        raise Refused(f"{args.key}: a value is missing; write {EXAMPLE}", 2)
    args.value = words[0] if words else "{}"
    if args.value == "-":
        args.value = sys.stdin.read(values.LARGEST + 1)
    row = wire.topic(args.key)
    if given:
        try:
            form = forms.named(given, args.wire, args.force, args.package)
        except ValueError as error:
            raise Refused(f"{args.key}: {error}") from None
        right = [kind.ROS for kind in row.types] if row else [form.kind.ROS]
        if form.kind.ROS not in right and not args.force:
            raise Refused(f"{args.key}: its type is {' or '.join(right)}, not {given}{forms.FORCE}")
        return form
    return Ours(row.types, args.wire, args.force) if row else None


def _form_of_listener(found: list[Endpoint], args: "argparse.Namespace") -> Form:
    """A robot's file may call its topics anything: the type is that of whoever reads the key."""
    wanted = {end.type for end in on_key(found, args.key, "sub")}
    if kinds := values.kinds_of(wanted):
        return Ours(kinds, args.wire, args.force)
    for name in sorted(wanted):
        with contextlib.suppress(ValueError):
            return forms.named(name, args.wire, args.force, args.package)
    known = ", ".join(topic.key for topic in wire.TOPICS)
    raise Refused(
        f"{args.key!r} has no known type; known keys: {known}, each also as ROBOT/key;"
        f" for any other give the type: holozen topic pub {args.key} geometry_msgs/msg/Twist VALUE"
    )


def _payload(form: Form, args: "argparse.Namespace") -> bytes:
    try:
        return b"" if args.stdin else form.payload(args.value)
    except ValueError as error:
        raise Refused(f"{args.key}: refused: {error}") from None


def _matched(
    bus: Bus,
    publisher: Publisher[Message],
    args: "argparse.Namespace",
    stop: "threading.Event",
    looking: "Callable[[], list[Endpoint]]",
) -> int:
    """Wait for subscribers; how many there are. Strangers show only that there are any, and count as one."""
    wanted, deadline = args.wait or 1, None if args.wait else time.monotonic() + PATIENCE
    if args.max_wait:
        deadline = time.monotonic() + args.max_wait
    graph, told = None, False
    while True:
        while not publisher.matched and (deadline is None or time.monotonic() < deadline):
            if stop.wait(0.002):
                return 0
        if len(ends := on_key(looking(), args.key, "sub")) < wanted:  # that look was too early
            graph = graph or bus.graph()
            ends = on_key(graph.settled(bus.connected), args.key, "sub")
        found = max(len(ends), int(publisher.matched))
        if found >= wanted or (deadline and time.monotonic() > deadline) or stop.wait(0.01):
            return found
        if not told:
            say(f"waiting for {wanted} subscribers of {args.key}; {found} by now")
            told = True


def _turns(form: Form, payload: bytes, args: "argparse.Namespace", stop: "threading.Event") -> "Iterator[bytes]":
    """The value as often as is asked for, in time."""
    row = wire.topic(args.key)
    period = 1 / (args.rate or (row.rate if row else 1.0))
    left, due = 1 if args.once else args.times, time.monotonic()
    while not stop.is_set() and left != 0:
        yield payload
        payload = _payload(form, args) if values.tells_time(args.value) else payload
        left = left and left - 1
        due += period
        if not args.once:  # the last one counts for a period too
            stop.wait(max(0.0, due - time.monotonic()))


def _lines(form: Form, args: "argparse.Namespace", stop: "threading.Event") -> "Iterator[bytes]":
    """A value for each line of standard input, no faster than the rate."""
    import queue
    import threading

    lines: queue.Queue[str] = queue.Queue(maxsize=1000)
    number = sys.stdin.fileno()

    def read() -> None:
        # What is no UTF-8 comes as text that no form takes, so that its line is told.
        with open(number, encoding="utf-8", errors="surrogateescape", closefd=False) as source:
            while line := source.readline(values.LARGEST + 1):
                lines.put(line)
        lines.put("")

    threading.Thread(target=read, daemon=True).start()
    at = 0
    while not stop.is_set():
        try:
            line = lines.get(timeout=LOOK)
        except queue.Empty:
            continue
        at += 1
        if not line:
            return
        if not line.strip():
            continue
        try:
            yield form.payload(line.strip())
        except ValueError as error:
            raise Refused(f"{args.key}: line {at} refused: {error}") from None
        if args.rate:
            stop.wait(1 / args.rate)


def _stop_robot(publisher: Publisher[Message], payload: bytes) -> None:
    """Send stops, more than one: a congested link drops some."""
    for _ in range(STOPS):
        publisher.put_bytes(payload)
        time.sleep(STOP_EVERY)
