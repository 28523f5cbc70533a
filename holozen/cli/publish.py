"""`holozen topic pub`: publish validated messages on a key, and report whether they arrive and are obeyed."""

from __future__ import annotations

import argparse
import contextlib
import json
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import msgspec

from holozen import limits, wire
from holozen import messages as m
from holozen.bus import Bus
from holozen.cli import values
from holozen.cli.hints import suggest_key
from holozen.cli.verb import PUB_EXAMPLE, PUB_PATIENCE
from holozen.console import report
from holozen.messages import CodecError, CommandStatus, Message, codec
from holozen.messages.message import not_finite
from holozen.process import stop_event
from holozen.suggest import suggest
from holozen.transport.graph import Endpoint, on_key, subscribers
from holozen.transport.pubsub import Publisher

if TYPE_CHECKING:
    from pathlib import Path

    from holozen.messages.definitions import Interface

STOPS, STOP_EVERY = 5, 0.02  # s
CLOCK_PATIENCE = 0.2  # s to wait for the robot to ask for our clock
LOOK = 0.1  # s between two checks for a line of standard input
VERDICT = 0.3, 2.0  # s to wait for the sim's status, which comes at 10 Hz: where none was found, and where one was
FRESH = 1.0  # s; an older status is ignored
FORCE = "; --force sends it all the same"
Kinds = tuple[type[Message], ...]


class Refused(Exception):
    """A value or command line that cannot be published: a one-line message, and the exit code."""

    def __init__(self, text: str, code: int = 1) -> None:
        super().__init__(text)
        self.code = code


def publish(bus: Bus, args: argparse.Namespace, looking: Callable[[], list[Endpoint]]) -> int:
    """Publish according to the flags. `looking` waits for the first query of the graph and returns its endpoints."""
    if set(args.key) & set("*$?#"):
        report(f"holozen topic pub: {args.key!r}: write to one key; a wildcard would move every robot")
        return 1
    try:
        form = _form(args)
        payload = _payload(form, args) if form else None
        _ = bus.session  # open it first, so that Ctrl-C also ends the wait for a router
        stop = stop_event()
        form = form or _form_of_listener(looking(), args)
        return _run(bus, args, form, payload or _payload(form, args), stop, looking)
    except Refused as error:
        report(f"holozen topic pub: {error}")
        return error.code


def _run(
    bus: Bus,
    args: argparse.Namespace,
    form: Form,
    payload: bytes,
    stop: threading.Event,
    looking: Callable[[], list[Endpoint]],
) -> int:
    publisher: Publisher[Message] = bus.publisher(args.key, form.kind)
    matched = 0 if args.no_wait else _matched(bus, publisher, args, stop, looking)
    if not args.no_wait:
        counted = f"{matched or 'no'} subscriber{'s' * (matched != 1)} of {args.key}"
        report(counted if matched else f"{counted}{suggest_key(bus, [args.key], ('sub',))}")
        if not matched and (args.once or args.times):
            return 1
        if args.wait and matched < args.wait and not stop.is_set():
            raise Refused(f"{args.key}: {args.wait} subscribers did not come in time, so nothing is published")
    stopping = form.stop()
    feedback = CommandFeedback(bus, args.key) if stopping else None
    if feedback and matched and payload != stopping:
        bus.clock_asked.wait(CLOCK_PATIENCE)  # only a stop is obeyed before the robot knows our clock
    turns = _lines(form, args, stop) if args.stdin else _turns(form, payload, args, stop)
    sent = 0
    try:
        for each in turns:
            publisher.put_bytes(each)
            sent += 1
            if feedback:
                feedback.look()
        if feedback and (args.once or args.times) and matched:
            feedback.wait(stop, VERDICT[bool(on_key(looking(), f"{args.key}_status", "pub"))])
    finally:
        if stopping and not args.once:
            _stop_robot(publisher, stopping)
    if args.json:
        print(json.dumps({"key": args.key, "type": form.kind.ROS, "subscribers": matched, "published": sent}))
    return int(bool(feedback and feedback.refusal and (args.once or args.times) and payload != stopping))


def _form(args: argparse.Namespace) -> Form | None:
    """The form of the given type, else of the wire table's row; None if only a subscriber can determine it."""
    words = list(args.words)
    given = words.pop(0) if words and values.TYPE.fullmatch(words[0]) else ""
    if len(words) > 1 or (args.stdin and words):
        raise Refused(f"{args.key}: {words[-1]!r} is too much; write KEY [TYPE] VALUE", 2)
    if not (words or given or args.stdin):
        raise Refused(f"{args.key}: a value is missing; write holozen topic pub {PUB_EXAMPLE}", 2)
    args.value = words[0] if words else "{}"
    if args.value == "-":
        args.value = sys.stdin.read(values.LARGEST + 1)
    row = wire.topic(args.key)
    if given:
        try:
            form = form_named(given, args.key, args.wire, args.force, args.package)
        except ValueError as error:
            raise Refused(f"{args.key}: {error}") from None
        right = [kind.ROS for kind in row.types] if row else [form.kind.ROS]
        if form.kind.ROS not in right and not args.force:
            raise Refused(f"{args.key}: its type is {' or '.join(right)}, not {given}{FORCE}")
        return form
    return Ours(row.types, args.key, args.wire, args.force) if row else None


def _form_of_listener(found: list[Endpoint], args: argparse.Namespace) -> Form:
    """The form of the type that the key's subscribers expect: a robot's file may give its topics any name."""
    wanted = {end.type for end in on_key(found, args.key, "sub")}
    if kinds := kinds_of(wanted):
        return Ours(kinds, args.key, args.wire, args.force)
    for name in sorted(wanted):
        with contextlib.suppress(ValueError):
            return form_named(name, args.key, args.wire, args.force, args.package)
    known = [topic.key for topic in wire.TOPICS]
    robot = args.key[: args.key.rfind("/") + 1]
    near = suggest(args.key, [*(f"{robot}{key}" for key in known), *(end.key for end in found if end.kind == "sub")])
    raise Refused(
        f"{args.key!r} has no known type{near}; known keys: {', '.join(known)}, each also as ROBOT/key;"
        f" for any other give the type: holozen topic pub {args.key} geometry_msgs/msg/Twist VALUE"
    )


def _payload(form: Form, args: argparse.Namespace) -> bytes:
    try:
        return b"" if args.stdin else form.payload(args.value)
    except ValueError as error:
        raise Refused(f"{args.key}: refused: {error}") from None


def _matched(
    bus: Bus,
    publisher: Publisher[Message],
    args: argparse.Namespace,
    stop: threading.Event,
    looking: Callable[[], list[Endpoint]],
) -> int:
    """Wait for subscribers and return their number. Foreign nodes only show that there are any, and count as one."""
    wanted, deadline = args.wait or 1, None if args.wait else time.monotonic() + PUB_PATIENCE
    if args.max_wait:
        deadline = time.monotonic() + args.max_wait
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
            report(f"waiting for {wanted} subscribers of {args.key}; {found} by now")
            reported = True


def _turns(form: Form, payload: bytes, args: argparse.Namespace, stop: threading.Event) -> Iterator[bytes]:
    """The value, as often as requested, paced by the rate."""
    row = wire.topic(args.key)
    period = 1 / (args.rate or (row.rate if row else 1.0))
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
            raise Refused(f"{args.key}: line {at} refused: {error}") from None
        if args.rate:
            stop.wait(1 / args.rate)


def _stop_robot(publisher: Publisher[Message], payload: bytes) -> None:
    """Send several stops, because a congested link may drop some."""
    for _ in range(STOPS):
        publisher.put_bytes(payload)
        time.sleep(STOP_EVERY)


LIMITED = "over the limits"  # prefix of the sim's reason when it drives slower than commanded
OVERRULED = "overruled"  # prefix of its reason when a higher source drives
HELD = "held, since a higher source took over; `holozen service call resume` lets it drive again"


def verdict(status: CommandStatus, source: str) -> str | None:
    """Why the robot does not follow the commands of `source`; empty if it does. None if the sim has not received any
    yet: a status sent before the command arrived does not cover it.
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
        return f"{status.obeyed} drives"
    return own_refusal or None


class CommandFeedback:
    """Reports when the robot on a command key starts or stops obeying."""

    def __init__(self, bus: Bus, key: str) -> None:
        self._bus, self._reported = bus, ""
        self.refusal = ""
        """Why the robot does not obey, by the latest look; empty if it does, or is not known to."""
        self._latest = bus.latest(f"{key}_status", CommandStatus)

    def look(self) -> bool:
        """Report any change; returns whether the sim has judged our commands yet."""
        status, age = self._latest.read()
        why = verdict(status, self._bus.source) if status and age < FRESH else None
        if why is None:
            return False
        if why != self._reported:
            report(why if why.startswith(LIMITED) else f"not obeyed: {why}" if why else "obeyed again")
        self._reported, self.refusal = why, "" if why.startswith(LIMITED) else why
        return True

    def wait(self, stop: threading.Event, seconds: float) -> None:
        """Wait until the sim has judged our commands, at most `seconds`."""
        deadline = time.monotonic() + seconds
        while not self.look() and time.monotonic() < deadline and not stop.wait(0.002):
            pass


# The value.


def kinds_named(name: str) -> Kinds:
    """Our type of a ROS name, such as geometry_msgs/msg/Twist or geometry_msgs/Twist; empty if we have none."""
    package, _, last = name.replace("/msg/", "/").partition("/")
    ours = [kind for kind in vars(m).values() if isinstance(kind, type) and issubclass(kind, Message)]
    ours += [kind for row in wire.TOPICS for kind in row.types]
    return tuple({kind: 0 for kind in ours if f"{package}/msg/{last}" == kind.ROS})


def kinds_of(types: set[str]) -> Kinds:
    """Our types for the given ROS types: all that the wire table's row accepts, if there is one."""
    row = next((row for row in wire.TOPICS if {kind.ROS for kind in row.types} & types), None)
    return row.types if row else next((found for name in sorted(types) if (found := kinds_named(name))), ())


def read_message(text: str, kinds: Kinds) -> Message:
    """The message that `text` (JSON or YAML, or - for standard input) describes, of the first of `kinds` that fits. Its
    numbers may not be finite. Raises ValueError with the reason.
    """
    value = values.plain(text)
    try:
        return codec.convert(value, kinds, strict=True)
    except CodecError as error:
        raise ValueError(f"{error}{_field_hint(str(error), value, kinds)}") from None


def forced(message: Message, name: str) -> bytes:
    """The bytes of a message with numbers that are not finite, which `codec.encode` refuses."""
    if name == "json":
        return json.dumps(msgspec.to_builtins(message)).encode()
    if name == "msgpack":
        return msgspec.msgpack.encode(message)
    from holozen.messages import cdr
    from holozen.messages.registry import Registry

    return cdr.write(Registry().find(message.ROS), msgspec.to_builtins(message))


def _field_hint(reason: str, value: Any, kinds: Kinds) -> str:
    """The valid names in place of an unknown field in `reason`, the closest first."""
    word = reason.partition("unknown field `")[2].partition("`")[0]
    if not word:
        return ""
    place = reason.partition(" - at `$.")[2].partition("`")[0]
    known: Any = {}
    for kind in kinds:
        known = msgspec.to_builtins(kind())
        for name in filter(None, place.split(".")):
            known = known.get(name, {}) if isinstance(known, dict) else {}
        if known:
            break
    names = list(known) if isinstance(known, dict) else []
    return f"{suggest(word, names)}; there are {', '.join(names) or 'none'}"


class Ours:
    """Encodes values as one of our types, the first of `kinds` that fits."""

    def __init__(self, kinds: Kinds, key: str, encoding: str, force: bool) -> None:
        self.kind, self._kinds, self._wire, self._force = kinds[0], kinds, encoding, force
        self._is_command = wire.is_command(key, kinds)

    def payload(self, text: str) -> bytes:
        """The bytes of a written value; sets `kind` to its type. Raises ValueError with the reason."""
        message = read_message(text, self._kinds)
        self.kind = type(message)
        self._kinds = (self.kind,) if len(self._kinds) == 1 else self._kinds
        if (bad := not_finite(message)) and self._force:
            return forced(message, self._wire)
        if bad:
            raise ValueError(f"{self.kind.__name__}.{bad} is not a finite number{FORCE}")
        if self._is_command and not self._force and (bad := wire.implausible(message)):
            raise ValueError(f"{self.kind.__name__}.{bad}{FORCE}")
        return codec.encode(message, self._wire)

    def stop(self) -> bytes | None:
        """The bytes that stop a robot; None if this is no command."""
        moves = self.kind.__name__ in ("Twist", "TwistStamped")
        return codec.encode(self.kind(), self._wire) if moves else None


class Foreign:
    """Encodes values as any type that has a definition."""

    def __init__(self, interface: Interface, wire: str, force: bool) -> None:
        self._interface, self._wire, self._force = interface, wire, force
        self.kind: type[Message] = type("Foreign", (Message,), {"__module__": __name__})
        self.kind.ROS = interface.name  # not the name that follows from the module

    def payload(self, text: str) -> bytes:
        """The bytes of a written value. Raises ValueError with the reason."""
        from holozen.messages.definitions import completed

        value = completed(self._interface, values.plain(text))
        if not self._force and (bad := limits.not_finite(value)):
            raise ValueError(f"{bad} is not a finite number{FORCE}")
        if self._wire == "cdr":
            from holozen.messages import cdr

            return cdr.write(self._interface, value)
        if self._wire == "msgpack":
            return msgspec.msgpack.encode(value)
        return json.dumps(value).encode()

    def stop(self) -> bytes | None:
        """None: no command of ours."""
        return None


Form = Ours | Foreign


def form_named(name: str, key: str, wire: str, force: bool, packages: Iterable[tuple[str, Path]] = ()) -> Form:
    """The form of a type for a `key`; `packages` are those of `--package`. Raises ValueError for an unknown type,
    naming the closest known one.
    """
    given = dict(packages)
    if name.partition("/")[0] not in given and (kinds := kinds_named(name)):
        return Ours(kinds, key, wire, force)
    from holozen.messages.registry import Registry

    return Foreign(Registry(given).find(name), wire, force)
