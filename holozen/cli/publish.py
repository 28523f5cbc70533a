"""`holozen topic pub`: publish validated messages on a key, and report whether they arrive and are
obeyed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import count
from typing import Any

from holozen import wire
from holozen.bus import Bus
from holozen.cli import values
from holozen.cli.form import Form, form_of, form_of_listener
from holozen.cli.hints import suggest_key
from holozen.command.feedback import LATE, CommandFeedback
from holozen.console import Failure, report
from holozen.fields import as_object
from holozen.messages import WIRES, CodecError
from holozen.messages.definitions import Interface, InterfaceError, completed
from holozen.messages.registry import Registry
from holozen.output import decode
from holozen.process import stop_event
from holozen.suggest import listed
from holozen.transport import connection
from holozen.transport.beat import Echoes
from holozen.transport.denied import denied
from holozen.transport.graph import Endpoint, on_key, subscribers
from holozen.transport.pubsub import Latest, RawPublisher, Subscription
from holozen.transport.samples import Sample

STOPS, STOP_EVERY = 5, 0.02  # s
WAITING = "waiting for the robot: nothing was heard from it yet"
NO_BEAT = (
    "nothing was sent: the robot is there, but nothing was heard from it within {seconds:g} s; "
    "`holozen doctor` looks why"
)
NOTICE = 0.5  # s of waiting for a beat after which that is reported
BEAT_PATIENCE = 5.0  # s to wait for a beat where no --max-wait is given
STOP_CHECK = 0.1  # s of waiting for a line of standard input between two checks whether to stop
# s to wait for the robot's status, which comes at 10 Hz, where none was found
VERDICT_WITHOUT_STATUS = 0.3
VERDICT_WITH_STATUS = 2.0  # s, where one was
# s; a robot that stands may take the first command over a slow link for a late one
AGAIN, AGAIN_AFTER = (5, 0.1)
PAUSED = "; the sim is paused; `holozen sim play` continues it"
STEPS = (
    "the sim is paused: the robot moves in `holozen sim step` alone; after `holozen sim play`, "
    "send it again"
)
STATE_PAUSED = 2  # of simulation_interfaces/msg/SimulationState
LEFT = "; it has left, and its last command counts until the robot's timeout: try again in a moment"


def publish(bus: Bus, args: argparse.Namespace, looking: Callable[[], list[Endpoint]]) -> int:
    """Publish according to the flags. `looking` waits for the first query of the graph and returns
    its endpoints.
    """
    if set(args.key) & set("*$?#"):
        raise Failure(f"{args.key!r}: write to one key; a wildcard would move every robot")
    form = form_of(args)
    payload = _payload(form, args) if form else None
    _ = bus.session  # open it first, so that Ctrl-C also ends the wait for a router
    stop = stop_event()
    if form is None:
        form = form_of_listener(looking(), args)
        payload = _payload(form, args)
    return _run(bus, args, form, payload, stop, looking)


def _run(
    bus: Bus,
    args: argparse.Namespace,
    form: Form,
    payload: bytes | None,
    stop: threading.Event,
    looking: Callable[[], list[Endpoint]],
) -> int:
    """Publish the payload as often as the flags say, or without one the lines of standard input."""
    publisher = bus.publisher_raw(args.key, form.kind.name, form.encoding, dead_man=False)
    for why in denied(bus, connection.from_arguments(args), [args.key]).values():
        raise Failure(why)
    matched = 0 if args.no_wait else _await_subscribers(bus, publisher, args, stop, looking)
    status_key = form.status_key
    feedback = command_feedback(bus, status_key, form.is_velocity) if status_key else None
    if publisher.echoes and payload not in form.stops:
        _wait_for_beat(publisher.echoes, args, stop)
    sending = Sending(publisher, form, feedback, stop)
    try:
        if payload is None:
            sending.send_all(_lines(form, args, stop))
        else:
            sending.send_all(turns(form, payload, args, stop, sending.pause))
        if status_key and (args.once or args.times) and matched:
            has_status = bool(on_key(looking(), status_key, "pub"))
            sending.await_verdict(has_status, again=payload if args.once else None)
    finally:
        sending.end(stops_robot=not args.once)
    if args.json:
        print(
            json.dumps(
                {
                    "key": args.key,
                    "type": form.kind.name,
                    "subscribers": matched,
                    "published": sending.count,
                }
            )
        )
    if not (args.once or args.times):
        return 0
    if feedback and feedback.refusal:
        return int(payload not in form.stops or not feedback.stands)
    if status_key and matched and payload not in form.stops and _is_paused(bus, status_key):
        report(f"{args.key}: {STEPS}")
    return int(matched > 0 and form.is_goal and _report_without_controller(bus, args.key))


class Sending:
    """Sends messages on one key, and follows what a robot makes of them.

    Attributes:
        count: How many messages were sent.
    """

    def __init__(
        self,
        publisher: RawPublisher,
        form: Form,
        feedback: CommandFeedback | None,
        stop: threading.Event,
    ) -> None:
        self._publisher, self._form, self._feedback, self._stop = publisher, form, feedback, stop
        self.count = 0

    def send_all(self, payloads: Iterable[bytes]) -> None:
        """Send each payload."""
        for payload in payloads:
            self._send(payload)

    def _send(self, payload: bytes) -> None:
        if self._put(payload):
            self.count += 1
            if self._feedback:
                self._feedback.sent(self._form.command)

    def _put(self, payload: bytes) -> bool:
        """Send a message. A motion goes with an echo, or as a foreign program's, without a number,
        where no robot that beats is there. Returns False if it was not sent: the robot has come
        anew, and its beat was not heard yet.
        """
        echoes = self._publisher.echoes
        if echoes and payload not in self._form.stops and not echoes.heard:
            if not echoes.may_command():
                return False
            if not echoes.has_receiver:
                self._publisher.put_plain(payload)
                return True
        self._publisher.put_bytes(payload)
        return True

    def pause(self, seconds: float) -> None:
        """Wait after a message was sent, until `stop` is set."""
        if self._feedback:
            self._feedback.pause(self._stop, seconds)
        else:
            self._stop.wait(seconds)

    def await_verdict(self, has_status: bool, again: bytes | None) -> None:
        """Wait for what the robot makes of the last message, longer where it `has_status`. Send the
        payload `again` while that comes too late to begin with.
        """
        feedback = self._feedback
        if feedback is None:
            return
        patience = VERDICT_WITH_STATUS if has_status else VERDICT_WITHOUT_STATUS
        feedback.wait(self._stop, patience)
        if again is None:
            return
        for _ in range(AGAIN):
            if not feedback.refusal.startswith(LATE) or self._stop.wait(AGAIN_AFTER):
                return
            seen = feedback.statuses
            self._send(again)
            feedback.wait(self._stop, patience, seen)

    def end(self, stops_robot: bool) -> None:
        """Report what is left to be reported. With `stops_robot`, stop first what the messages
        move: each stop is sent several times, because a congested link may drop some.
        """
        stops = self._form.stops if stops_robot else set()
        for _ in range(STOPS if stops else 0):
            for payload in stops:
                self._publisher.put_bytes(payload)
            time.sleep(STOP_EVERY)
        if self._feedback:
            self._feedback.told()
            if stops:
                self._feedback.report_held()


def _payload(form: Form, args: argparse.Namespace) -> bytes | None:
    """The bytes of the value; None if values come line by line. Raises Failure."""
    return None if args.stdin else _encoded(form, args)


def _encoded(form: Form, args: argparse.Namespace) -> bytes:
    try:
        return form.payload(args.value)
    except ValueError as error:
        raise Failure(f"{args.key}: refused: {error}") from None


def _await_subscribers(
    bus: Bus,
    publisher: RawPublisher,
    args: argparse.Namespace,
    stop: threading.Event,
    looking: Callable[[], list[Endpoint]],
) -> int:
    """Wait for subscribers, and report and return their number. Raises Failure if there are too few
    to publish.
    """
    matched = _matched(bus, publisher, args, stop, looking)
    counted = f"{matched or 'no'} subscriber{'s' * (matched != 1)} of {args.key}"
    if not matched:
        counted += suggest_key(bus, [args.key], ("sub",))
        if args.once or args.times:
            raise Failure(counted)
    report(counted)
    if args.wait and matched < args.wait and not stop.is_set():
        raise Failure(
            f"{args.key}: {args.wait} subscribers did not come in time, so nothing is published"
        )
    return matched


def _wait_for_beat(echoes: Echoes, args: argparse.Namespace, stop: threading.Event) -> None:
    """Wait until a beat of a robot that is there was heard. Raises Failure if that takes too
    long.
    """
    echoes.settle()
    limit = args.max_wait or BEAT_PATIENCE
    deadline, reported = time.monotonic() + limit, False
    while echoes.awaited and not stop.is_set():
        if time.monotonic() > deadline:
            raise Failure(f"{args.key}: {NO_BEAT.format(seconds=limit)}")
        if not reported and time.monotonic() > deadline - limit + NOTICE:
            report(f"{args.key}: {WAITING}")
            reported = True
        stop.wait(0.002)


def _report_without_controller(bus: Bus, key: str) -> bool:
    """Report that no controller reads a goal, if all subscribers of its key read any type, as
    `topic echo` does. Returns whether that is so.
    """
    ends = on_key(bus.graph().settled(bus.connected), key, "sub")
    if not ends or any(end.type != "any/msg/Any" for end in ends):  # a foreign one has no token
        return False
    command = " ".join(filter(None, ("holozen controller", key.rpartition("/")[0], "--laps 0")))
    report(
        f"{key}: no controller reads it, only {listed(end.node for end in ends)}; `{command}` "
        "drives there"
    )
    return True


def _matched(
    bus: Bus,
    publisher: RawPublisher,
    args: argparse.Namespace,
    stop: threading.Event,
    looking: Callable[[], list[Endpoint]],
) -> int:
    """Wait for subscribers and return their number. Foreign nodes only show that there are any, and
    count as one.
    """
    wanted, deadline = args.wait or 1, args.max_wait and time.monotonic() + args.max_wait
    graph, reported = None, -1  # the number in the last report
    while True:
        while not publisher.matched and (deadline is None or time.monotonic() < deadline):
            if stop.wait(0.002):
                return 0
        # the first query was too early
        if len(on_key(ends := looking(), args.key, "sub")) < wanted:
            graph = graph or bus.graph()
            ends = graph.settled(bus.connected)
        found = subscribers(ends, args.key, publisher.matched)
        if found >= wanted or (deadline and time.monotonic() > deadline) or stop.wait(0.01):
            return found
        if found != reported:
            awaited = f"{wanted} subscribers" if wanted > 1 else "a subscriber"
            report(f"waiting for {awaited} to {args.key} ({found or 'none'} so far)")
            reported = found


def turns(
    form: Form,
    payload: bytes,
    args: argparse.Namespace,
    stop: threading.Event,
    pause: Callable[[float], object],
) -> Iterator[bytes]:
    """The value, as often as requested, paced by the rate: `pause` waits for so many seconds."""
    row = wire.topic(args.key)
    # Hz; of goals there is no usual rate
    period = 1 / (args.rate or (row.rate if row else 0) or 1.0)
    left, due = 1 if args.once else args.times, time.monotonic()
    while not stop.is_set() and left != 0:
        yield payload
        if values.is_time_dependent(args.value):
            payload = _encoded(form, args)
        left = left and left - 1
        due = max(due + period, time.monotonic())  # after a pause no burst makes up for it
        if not args.once:  # the last message also lasts one period
            pause(max(0.0, due - time.monotonic()))


def _lines(form: Form, args: argparse.Namespace, stop: threading.Event) -> Iterator[bytes]:
    """The bytes of each line of standard input, no faster than the rate."""
    lines: queue.Queue[str] = queue.Queue(maxsize=1000)
    threading.Thread(target=_read_lines, args=(sys.stdin.fileno(), lines), daemon=True).start()
    for number in count(1):
        line = _next_line(lines, stop)
        if not line:
            return
        if not line.strip():
            continue
        try:
            yield form.payload(line.strip())
        except ValueError as error:
            raise Failure(f"{args.key}: line {number} refused: {error}") from None
        if args.rate:
            stop.wait(1 / args.rate)


def _read_lines(file: int, lines: queue.Queue[str]) -> None:
    """Put the lines of a file descriptor into a queue, and an empty one at their end."""
    # Invalid UTF-8 is passed on as text that no form accepts, so that the error names its line.
    with open(file, encoding="utf-8", errors="surrogateescape", closefd=False) as source:
        while line := source.readline(values.LARGEST + 1):
            lines.put(line)
    lines.put("")


def _next_line(lines: queue.Queue[str], stop: threading.Event) -> str | None:
    """The next line; empty at the end of the input, None once `stop` is set."""
    while not stop.is_set():
        with contextlib.suppress(queue.Empty):
            return lines.get(timeout=STOP_CHECK)
    return None


def command_feedback(bus: Bus, key: str, is_velocity: bool = True) -> CommandFeedback:
    """Feedback about this node's commands from the command status on `key`."""

    def more(driver: str) -> str:
        if _is_paused(bus, key):
            return PAUSED
        # A driver without a node may be anyone's.
        nodes = {end.source for end in bus.endpoints()}
        return LEFT if "@" in driver and driver not in nodes else ""

    read = partial(_read, Registry().find("holozen/msg/CommandStatus"))
    latest: Latest[Any] = Latest(Subscription(bus.subscribe_raw(key, depth=1), read))
    return CommandFeedback(bus.source, key, latest, is_velocity, more=more)


def _is_paused(bus: Bus, status_key: str) -> bool:
    """Whether a sim that publishes the command status on this key is paused. One that does not
    answer is not. As `entities.is_paused`, whose module takes half as long to load as a verb takes.
    """
    ends = bus.endpoints()
    sims = {end.session for end in on_key(ends, status_key, "pub")}
    told = [end for end in on_key(ends, "simulation_status", "pub") if end.session in sims]
    kind = Registry().find("holozen/msg/SimulationStatus") if told else None
    for sample in bus.last_messages(told):
        with contextlib.suppress(CodecError):
            if kind and _read(kind, sample).state == STATE_PAUSED:
                return True
    return False


def _read(kind: Interface, sample: Sample) -> Any:
    """A message defined by `kind`, as an object; a newer sim may send more fields. Raises
    CodecError.
    """
    if sample.encoding.startswith(WIRES["cdr"]):
        from holozen.messages import cdr

        return as_object(cdr.read(kind, sample.payload))
    try:
        return as_object(completed(kind, decode(sample.payload, sample.encoding), tolerant=True))
    except InterfaceError as error:
        raise CodecError(str(error)) from None
