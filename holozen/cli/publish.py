"""`holozen topic pub`: publish validated messages on a key, and report whether they arrive and are obeyed."""

from __future__ import annotations

import argparse
import contextlib
import json
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from holozen import wire
from holozen.bus import Bus
from holozen.cli import values
from holozen.cli.fields import as_object
from holozen.cli.hints import suggest_key
from holozen.cli.output import decode
from holozen.command.feedback import CommandFeedback
from holozen.console import Failure, report
from holozen.limits import not_finite
from holozen.messages import WIRES, CodecError, encoding_of
from holozen.messages.definitions import Interface, InterfaceError, completed, with_mappings
from holozen.messages.registry import Registry
from holozen.process import stop_event
from holozen.suggest import listed, suggest
from holozen.transport.graph import Endpoint, on_key, subscribers
from holozen.transport.pubsub import Latest, RawPublisher, Subscription
from holozen.transport.samples import Sample

STOPS, STOP_EVERY = 5, 0.02  # s
CLOCK_PATIENCE = 0.2  # s to wait for the robot to ask for our clock
LOOK = 0.1  # s between two checks for a line of standard input
VERDICT = 0.3, 2.0  # s to wait for the sim's status, which comes at 10 Hz: where none was found, and where one was
PAUSED = "; the sim is paused; `holozen sim play` continues it"
LEFT = "; it has left, and its last command counts until the robot's timeout: try again in a moment"
FORCE = "; --force sends it all the same"


def publish(bus: Bus, args: argparse.Namespace, looking: Callable[[], list[Endpoint]]) -> int:
    """Publish according to the flags. `looking` waits for the first query of the graph and returns its endpoints."""
    if set(args.key) & set("*$?#"):
        raise Failure(f"{args.key!r}: write to one key; a wildcard would move every robot")
    form = _form(args)
    payload = _payload(form, args) if form else None
    _ = bus.session  # open it first, so that Ctrl-C also ends the wait for a router
    stop = stop_event()
    form = form or _form_of_listener(looking(), args)
    return _run(bus, args, form, payload or _payload(form, args), stop, looking)


def _run(
    bus: Bus,
    args: argparse.Namespace,
    form: Form,
    payload: bytes,
    stop: threading.Event,
    looking: Callable[[], list[Endpoint]],
) -> int:
    publisher = bus.publisher_raw(args.key, form.kind.name, form.encoding, dead_man=False)
    matched = 0 if args.no_wait else _matched(bus, publisher, args, stop, looking)
    if not args.no_wait:
        counted = f"{matched or 'no'} subscriber{'s' * (matched != 1)} of {args.key}"
        counted += "" if matched else suggest_key(bus, [args.key], ("sub",))
        if not matched and (args.once or args.times):
            raise Failure(counted)
        report(counted)
        if args.wait and matched < args.wait and not stop.is_set():
            raise Failure(f"{args.key}: {args.wait} subscribers did not come in time, so nothing is published")
    status_key = form.status_key
    feedback = command_feedback(bus, status_key, form.is_velocity) if status_key else None
    if feedback and matched and payload not in form.stops:
        bus.clock_asked.wait(CLOCK_PATIENCE)  # only a stop is obeyed before the robot knows our clock
    turns = _lines(form, args, stop) if args.stdin else _turns(form, payload, args, stop)
    sent = 0
    try:
        for each in turns:
            publisher.put_bytes(each)
            sent += 1
            if feedback:
                feedback.sent(form.command)
        if feedback and (args.once or args.times) and matched:
            feedback.wait(stop, VERDICT[bool(on_key(looking(), status_key, "pub"))])
    finally:
        if form.stops and not args.once:
            _stop_robot(publisher, form.stops)
            if feedback:
                feedback.report_held()
    if args.json:
        print(json.dumps({"key": args.key, "type": form.kind.name, "subscribers": matched, "published": sent}))
    if not (args.once or args.times):
        return 0
    if not feedback or not feedback.refusal:
        return int(matched and form.is_goal and _is_only_watched(bus, args.key))
    return int(payload not in form.stops or not feedback.stands)


def _is_only_watched(bus: Bus, key: str) -> bool:
    """Report that no controller reads a goal, if all subscribers of its key read any type, as `topic echo` does."""
    ends = on_key(bus.graph().settled(bus.connected), key, "sub")
    if not ends or any(end.type != "any/msg/Any" for end in ends):  # a foreign one has no token
        return False
    command = " ".join(filter(None, ("holozen controller", key.rpartition("/")[0], "--laps 0")))
    report(f"{key}: no controller reads it, only {listed(end.node for end in ends)}; `{command}` drives there")
    return True


def _form(args: argparse.Namespace) -> Form | None:
    """The form of the given type, else of the wire table's row; None if only a subscriber can determine it."""
    args.value = "{}" if args.value is None else args.value
    if args.value == "-":
        args.value = sys.stdin.read(values.LARGEST + 1)
    row = wire.topic(args.key)
    if not args.type:
        return Form(args, row.type_names) if row else None
    try:
        form = Form(args, [args.type])
    except ValueError as error:
        raise Failure(f"{args.key}: {error}") from None
    if row and form.kind.name not in row.type_names and not args.force:
        raise Failure(f"{args.key}: its type is {' or '.join(row.type_names)}, not {args.type}{FORCE}")
    return form


def _form_of_listener(found: list[Endpoint], args: argparse.Namespace) -> Form:
    """The form of the type that the key's subscribers expect: a robot's file may give its topics any name."""
    wanted = {end.type for end in on_key(found, args.key, "sub")}
    if row := next((row for row in wire.TOPICS if wanted.intersection(row.type_names)), None):
        return Form(args, row.type_names)
    for name in sorted(wanted):
        with contextlib.suppress(ValueError):
            return Form(args, [name])
    known = [topic.key for topic in wire.TOPICS]
    robot = args.key[: args.key.rfind("/") + 1]
    near = suggest(args.key, [*(f"{robot}{key}" for key in known), *(end.key for end in found if end.kind == "sub")])
    raise Failure(
        f"{args.key!r} has no known type{near}; known keys: {', '.join(known)}, each also as ROBOT/key;"
        f" for any other give the type: holozen topic pub {args.key} geometry_msgs/msg/Twist VALUE"
    )


def _payload(form: Form, args: argparse.Namespace) -> bytes:
    try:
        return b"" if args.stdin else form.payload(args.value)
    except ValueError as error:
        raise Failure(f"{args.key}: refused: {error}") from None


def _matched(
    bus: Bus,
    publisher: RawPublisher,
    args: argparse.Namespace,
    stop: threading.Event,
    looking: Callable[[], list[Endpoint]],
) -> int:
    """Wait for subscribers and return their number. Foreign nodes only show that there are any, and count as one."""
    wanted, deadline = args.wait or 1, args.max_wait and time.monotonic() + args.max_wait
    graph, reported = None, False
    while True:
        while not publisher.matched and (deadline is None or time.monotonic() < deadline):
            if stop.wait(0.002):
                return 0
        if len(on_key(ends := looking(), args.key, "sub")) < wanted:  # the first query was too early
            graph = graph or bus.graph()
            ends = graph.settled(bus.connected)
        found = subscribers(ends, args.key, publisher.matched)
        if found >= wanted or (deadline and time.monotonic() > deadline) or stop.wait(0.01):
            return found
        if not reported:
            awaited = f"{wanted} subscribers" if wanted > 1 else "a subscriber"
            report(f"waiting for {awaited} to {args.key} ({found or 'none'} so far)")
            reported = True


def _turns(form: Form, payload: bytes, args: argparse.Namespace, stop: threading.Event) -> Iterator[bytes]:
    """The value, as often as requested, paced by the rate."""
    row = wire.topic(args.key)
    period = 1 / (args.rate or (row.rate if row else 0) or 1.0)  # Hz; of goals there is no usual rate
    left, due = 1 if args.once else args.times, time.monotonic()
    while not stop.is_set() and left != 0:
        yield payload
        payload = _payload(form, args) if values.is_time_dependent(args.value) else payload
        left = left and left - 1
        due += period
        if not args.once:  # the last message also lasts one period
            stop.wait(max(0.0, due - time.monotonic()))


def _lines(form: Form, args: argparse.Namespace, stop: threading.Event) -> Iterator[bytes]:
    """The bytes of each line of standard input, no faster than the rate."""
    lines: queue.Queue[str] = queue.Queue(maxsize=1000)
    number = sys.stdin.fileno()

    def read() -> None:
        # Invalid UTF-8 is passed on as text that no form accepts, so that the error names its line.
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
            raise Failure(f"{args.key}: line {at} refused: {error}") from None
        if args.rate:
            stop.wait(1 / args.rate)


def _stop_robot(publisher: RawPublisher, stops: set[bytes]) -> None:
    """Send each of the `stops` several times, because a congested link may drop some."""
    for _ in range(STOPS):
        for payload in stops:
            publisher.put_bytes(payload)
        time.sleep(STOP_EVERY)


def command_feedback(bus: Bus, key: str, is_velocity: bool = True) -> CommandFeedback:
    """Feedback about this node's commands from the command status on `key`."""

    def more(driver: str) -> str:
        from holozen import entities

        ends = bus.endpoints()
        sims = {end.session for end in on_key(ends, key, "pub")}
        if entities.is_paused(bus, [end for end in ends if end.session in sims]):
            return PAUSED
        # A driver without a node may be anyone's.
        return LEFT if "@" in driver and driver not in {end.source for end in ends} else ""

    read = partial(_status, Registry().find("holozen/msg/CommandStatus"))
    latest: Latest[Any] = Latest(Subscription(bus.subscribe_raw(key, depth=1), read))
    return CommandFeedback(bus.source, key, latest, is_velocity, more=more)


def _status(kind: Interface, sample: Sample) -> Any:
    """A CommandStatus, defined by `kind`, as an object; a newer sim may send more fields. Raises CodecError."""
    if sample.encoding.startswith(WIRES["cdr"]):
        from holozen.messages import cdr

        return as_object(cdr.read(kind, sample.payload))
    try:
        return as_object(completed(kind, decode(sample.payload, sample.encoding), tolerant=True))
    except InterfaceError as error:
        raise CodecError(str(error)) from None


# The value.


class Form:
    """Encodes values as the first of some types that fits: `kind`, once there is one."""

    def __init__(self, args: argparse.Namespace, type_names: Sequence[str]) -> None:
        """Raises ValueError for an unknown type, with the most similar one."""
        registry = Registry(dict(args.package))
        self._kinds = [registry.find(name) for name in type_names]
        self.kind, self._wire, self._force = self._kinds[0], args.wire, args.force
        # A package that is given has its own types, whatever their names are here.
        ours = not any(name.startswith(f"{package}/") for package, _ in args.package for name in type_names)
        self._key, self._is_command = args.key, ours and wire.is_command(args.key, type_names)
        self.stops: set[bytes] = set()
        """The bytes that stop what its payloads move."""
        self.command: Any = None
        """The last payload as an object, if it is a command."""

    @property
    def encoding(self) -> str:
        """The Encoding of its bytes."""
        return encoding_of(self._wire, self.kind.name)

    @property
    def is_velocity(self) -> bool:
        """Whether it commands a velocity."""
        return self._is_command and self.kind.name in wire.VELOCITIES

    @property
    def is_goal(self) -> bool:
        """Whether it is a goal, to which a controller drives."""
        return self._is_command and not self.status_key

    @property
    def status_key(self) -> str:
        """The key of the status of its commands: for joints and forces that of the robot's cmd_vel; empty for goals."""
        if self.is_velocity:
            return f"{self._key}_status"
        moves = self._is_command and self.kind.name in ("sensor_msgs/msg/JointState", "geometry_msgs/msg/Wrench")
        return wire.key_for("cmd_vel_status", self._key.rpartition("/")[0]) if moves else ""

    def payload(self, text: str) -> bytes:
        """The bytes of a written value. Raises ValueError with the reason."""
        value = self._message(values.plain(text))
        bad = not_finite(value)
        if bad and not self._force:
            raise ValueError(f"{bad} is not a finite number{FORCE}")
        if self._is_command:
            command = self.command = as_object(value)
            if not self._force and (bad := wire.implausible(command, self.kind.name)):
                raise ValueError(f"{bad}{FORCE}")
            if (fields := wire.stop(command, self.kind.name)) is not None:
                self.stops.add(written(self.kind, completed(self.kind, fields), self._wire))
        return written(self.kind, value, self._wire)

    def _message(self, value: Any) -> dict[str, Any]:
        """All fields of the first type that fits; the error is that of the type with most of the names."""
        names = set(value) if isinstance(value, dict) else set()
        best = max(self._kinds, key=lambda kind: len(names.intersection(field.name for field in kind.fields)))
        for kind in self._kinds:
            with contextlib.suppress(InterfaceError):
                found, self.kind = completed(kind, value), kind
                return found
        return completed(best, value)


def written(kind: Interface, value: dict[str, Any], wire: str) -> bytes:
    """The bytes of a message with all its fields, whose numbers need not be finite as for `codec.encode`."""
    if wire == "cdr":
        from holozen.messages import cdr

        return cdr.write(kind, value)
    value = with_mappings(kind, value)
    if wire == "json":
        return json.dumps(value, separators=(",", ":")).encode()
    import msgspec

    return msgspec.msgpack.encode(value)
