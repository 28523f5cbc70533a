"""`holozen topic pub`: publish validated messages on a key, and report whether they arrive and are obeyed."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

from holozen import wire
from holozen.bus import Bus
from holozen.cli import values
from holozen.cli.hints import suggest_key
from holozen.cli.output import decode
from holozen.console import Failure, report
from holozen.limits import not_finite
from holozen.messages import WIRES, CodecError, encoding_of
from holozen.messages.definitions import Interface, InterfaceError, completed, with_mappings
from holozen.messages.registry import Registry
from holozen.process import stop_event
from holozen.suggest import suggest
from holozen.transport.graph import Endpoint, on_key, subscribers
from holozen.transport.pubsub import Latest, RawPublisher, Subscription
from holozen.transport.samples import Sample

STOPS, STOP_EVERY = 5, 0.02  # s
CLOCK_PATIENCE = 0.2  # s to wait for the robot to ask for our clock
LOOK = 0.1  # s between two checks for a line of standard input
VERDICT = 0.3, 2.0  # s to wait for the sim's status, which comes at 10 Hz: where none was found, and where one was
FRESH = 1.0  # s; an older status is ignored
COVERED = 3  # statuses after a command, of which the last was sent after the command has been read
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
    feedback = CommandFeedback(bus, status_key, form.is_velocity) if status_key else None
    if feedback and matched and payload not in form.stops:
        bus.clock_asked.wait(CLOCK_PATIENCE)  # only a stop is obeyed before the robot knows our clock
    turns = _lines(form, args, stop) if args.stdin else _turns(form, payload, args, stop)
    sent = 0
    try:
        for each in turns:
            publisher.put_bytes(each)
            sent += 1
            if feedback:
                feedback.strafes = form.strafes
                feedback.look()
        if feedback and (args.once or args.times) and matched:
            feedback.wait(stop, VERDICT[bool(on_key(looking(), status_key, "pub"))])
    finally:
        if form.stops and not args.once:
            _stop_robot(publisher, form.stops)
    if args.json:
        print(json.dumps({"key": args.key, "type": form.kind.name, "subscribers": matched, "published": sent}))
    return int(bool(feedback and feedback.refusal and (args.once or args.times) and payload not in form.stops))


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


LIMITED = "over the limits"  # prefix of the sim's reason when it drives slower than commanded
OVERRULED = "overruled"  # prefix of its reason when a higher source drives
DRIVES = " drives"
PAUSED = "; the sim is paused; `holozen sim play` continues it"
LEFT = "; it has left, and its last command counts until the robot's timeout: try again in a moment"
ONLY_TURNS = "linear.y is ignored: this robot's drive only goes forward, backward and turns"
HELD = "held, since a higher source took over"
RESUME = "; `{command}` lets it drive again"


def verdict(status: Any, source: str) -> str | None:
    """Why the robot does not follow the commands of `source`, by a CommandStatus; empty if it does. None if the sim has
    not received any yet: a status sent before the command arrived does not cover it.
    """
    mine = next((each for each in status.sources if each.source == source), None)
    own_refusal = status.last_refusal.removeprefix(f"{source}: ")
    if own_refusal == status.last_refusal:
        own_refusal = ""
    if status.stopped:
        return f"{status.stopped} has set the software stop"
    if status.obeyed == source or (mine and mine.obeyed):
        return own_refusal if own_refusal.startswith(LIMITED) else ""
    if mine and mine.held:
        return HELD
    if mine and status.obeyed and own_refusal.partition(":")[0] in ("", OVERRULED):
        return f"{status.obeyed}{DRIVES}"
    return own_refusal or None


def verdict_on_part(status: Any, before: Any, source: str) -> str | None:
    """As `verdict`, of commands to joints or forces, whose sources a status names only where they drive or are refused.
    `before` is the status before it: a command that is accepted after a refusal is known by the counts.
    """
    why = verdict(status, source)
    if not why or status.stopped or status.refused != before.refused:
        return why
    return "" if status.accepted > before.accepted and not status.obeyed and not status.sources else None


def _status(kind: Interface, sample: Sample) -> Any:
    """A CommandStatus, defined by `kind`, as an object; a newer sim may send more fields. Raises CodecError."""
    if sample.encoding.startswith(WIRES["cdr"]):
        from holozen.messages import cdr

        return _object(cdr.read(kind, sample.payload))
    try:
        return _object(completed(kind, decode(sample.payload, sample.encoding), tolerant=True))
    except InterfaceError as error:
        raise CodecError(str(error)) from None


class CommandFeedback:
    """Reports when the robot with the command status on `key` starts or stops obeying. If the commands are no
    velocities (`is_velocity`) but move joints or are forces, they are judged by `verdict_on_part`.
    """

    def __init__(self, bus: Bus, key: str, is_velocity: bool = True) -> None:
        self._bus, self._key, self._is_velocity, self._reported = bus, key, is_velocity, ""
        self._judged: Any = None  # the last status, and the one before
        self._before: Any = None
        self._has_noted = False
        self.strafes = False
        """Whether the commands have a sideways part, which not every drive can make."""
        self.refusal = ""
        """Why the robot does not obey, by the latest look; empty if it does, or is not known to."""
        read = partial(_status, Registry().find("holozen/msg/CommandStatus"))
        self._latest: Latest[Any] = Latest(Subscription(bus.subscribe_raw(key, depth=1), read))

    def look(self) -> bool:
        """Report any change; returns whether the sim has judged our commands yet."""
        status, age = self._latest.read()
        why = self._verdict(status) if status and age < FRESH else None
        if why is None:
            return False
        if why != self._reported:
            driver = status.obeyed if status and why.endswith(DRIVES) else ""
            if why and not why.startswith(LIMITED):
                ending = PAUSED if self._is_paused() else LEFT if self._has_left(driver) else ""
                command = wire.resume_command(self._key.rpartition("/")[0])
                resume = RESUME.format(command=command) if why == HELD else ""
                report(f"not obeyed: {why}{resume}{ending}")
            else:
                report(why or "obeyed again")
        if status and self.strafes and status.obeyed == self._bus.source and not (status.strafes or self._has_noted):
            report(ONLY_TURNS)
            self._has_noted = True
        self._reported, self.refusal = why, "" if why.startswith(LIMITED) else why
        return True

    def _verdict(self, status: Any) -> str | None:
        if self._is_velocity:
            return verdict(status, self._bus.source)
        if status is not self._judged:
            self._before, self._judged = self._judged or SimpleNamespace(refused=None, accepted=math.inf), status
        return verdict_on_part(status, self._before, self._bus.source)

    def _has_left(self, driver: str) -> bool:
        """Whether a source is none of the nodes that are there; one without a node may be anyone's."""
        return "@" in driver and driver not in {end.source for end in self._bus.endpoints()}

    def _is_paused(self) -> bool:
        """Whether the robot's sim is paused."""
        from holozen import entities

        ends = self._bus.endpoints()
        sims = {end.session for end in on_key(ends, self._key, "pub")}
        return entities.is_paused(self._bus, [end for end in ends if end.session in sims])

    def wait(self, stop: threading.Event, seconds: float) -> None:
        """Wait until the sim has judged our commands; report if it has not after so many `seconds`."""
        deadline, received = time.monotonic() + seconds, self._latest.count
        while not self.look() and not stop.wait(0.002):
            if not self._is_velocity and self._latest.count >= received + COVERED:
                return  # it says nothing of what it accepts
            if time.monotonic() > deadline:
                if self._latest.read()[1] < FRESH and self._is_velocity:
                    self.refusal = "the sim has not received it; does anything flood it?"
                    report(f"not obeyed: {self.refusal}")
                return


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
        self.strafes = False
        """Whether a payload commands a velocity with a sideways part."""

    @property
    def encoding(self) -> str:
        """The Encoding of its bytes."""
        return encoding_of(self._wire, self.kind.name)

    @property
    def is_velocity(self) -> bool:
        """Whether it commands a velocity."""
        return self._is_command and self.kind.name in ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")

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
            command = _object(value)
            if not self._force and (bad := wire.implausible(command, self.kind.name)):
                raise ValueError(f"{bad}{FORCE}")
            if (fields := wire.stop(command, self.kind.name)) is not None:
                self.stops.add(written(self.kind, completed(self.kind, fields), self._wire))
            if self.is_velocity:
                self.strafes |= getattr(command, "twist", command).linear.y != 0
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


def _object(value: Any) -> Any:
    """Plain values with their fields as attributes."""
    if isinstance(value, dict):
        return SimpleNamespace(**{name: _object(inner) for name, inner in value.items()})
    return [_object(inner) for inner in value] if isinstance(value, list) else value
