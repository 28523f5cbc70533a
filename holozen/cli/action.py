"""`holozen action`: inspect actions, and send goals."""

from __future__ import annotations

import argparse
import json
import re
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from holozen.background import background
from holozen.bus import Bus
from holozen.cli.hints import unknown
from holozen.cli.keys import print_list, print_sides
from holozen.cli.output import CDR, Reader, lines
from holozen.cli.verb import Noun, Verb, by_name, key_argument, list_arguments, open_bus
from holozen.console import printable, report
from holozen.flags import add_packages, key, number
from holozen.process import deferred_interrupt, stop_event
from holozen.suggest import suggest
from holozen.transport.actions import (
    CANCEL,
    FEEDBACK,
    SEND,
    Found,
    State,
    found_in,
    key_of,
    new_id,
    wait_for_result,
)
from holozen.transport.errors import BusError, NoReply
from holozen.transport.services import call_bytes

if TYPE_CHECKING:
    from holozen.messages.definitions import Interface

TYPE = re.compile(r"\w+/(action/)?\w+")
JSON = "application/json"
END = 10.0  # s for a goal to end that is to be cancelled
POLL = 0.02  # s between two looks for feedback


def list_actions(args: argparse.Namespace) -> int:
    """Print each action once."""
    with open_bus(args) as bus:
        ends, where = bus.endpoints(), bus.where
    return print_list(args, "action", ((action.key, action.type) for action in found_in(ends)), ends, where)


def info(args: argparse.Namespace) -> int:
    """Print an action's type, clients and servers; exit code 1 if it has none."""
    with open_bus(args) as bus:
        found, where = found_in(bus.endpoints()), bus.where
    mine = [one for one in found if one.key == args.key]
    if not mine:
        report(f"holozen action info: {unknown(args.key, sorted({one.key for one in found}), where)}")
        return 1
    clients, servers = ([one for one in mine if one.is_server == is_server] for is_server in (False, True))
    sides = {"clients": ("Action clients", clients), "servers": ("Action servers", servers)}
    return print_sides(args, [one.type for one in mine], sides)


def send_goal(args: argparse.Namespace) -> int:
    """Send a goal and print its result; exit code 1 unless it succeeds. Ctrl-C cancels the goal."""
    stop = stop_event()
    with open_bus(args, stop) as bus:
        words = list(args.words)
        given = words.pop(0) if words and TYPE.fullmatch(words[0]) else ""
        if len(words) > 1:
            report(f"holozen action send_goal: {args.key}: {words[-1]!r} is too much; write KEY [TYPE] GOAL")
            return 2
        try:
            server = _server(bus, args, stop)
            goal = _goal(bus, args, server.type, given, words[0] if words else "{}") if server else {}
        except ValueError as error:
            report(f"holozen action send_goal: {args.key}: {error}")
            return 1
        if server is None or stop.is_set():
            return 130
        return Errand(bus, args, server.type).run(goal, stop)


def _server(bus: Bus, args: argparse.Namespace, stop: threading.Event) -> Found | None:
    """The server of the action, waited for; None once `stop` is set. Raises ValueError if there is none in time."""
    deadline, found = time.monotonic() + args.timeout, list[Found]()
    with bus.graph() as graph:
        ends = graph.settled(bus.connected)
        while not stop.is_set():
            found = found_in(ends)
            if server := next((one for one in found if one.is_server and one.key == args.key), None):
                return server
            if time.monotonic() > deadline:
                near = suggest(args.key, sorted({one.key for one in found}))
                text = (
                    f"it has no server at {bus.where} within {args.timeout:g} s{near}; `holozen action list` lists all"
                )
                raise ValueError(text)
            stop.wait(POLL)
            ends = graph.endpoints()
    return None


def _goal(bus: Bus, args: argparse.Namespace, actual: str, given: str, text: str) -> Any:
    """The goal that `text` describes, as plain values. Raises ValueError."""
    with deferred_interrupt():
        from holozen.cli import values
        from holozen.limits import not_finite
        from holozen.messages.definitions import completed
        from holozen.messages.registry import Registry

    full = given.replace("/", "/action/") if given.count("/") == 1 else given
    if full and full != actual:
        raise ValueError(f"its type is {actual}, not {full}")
    kind: Interface = Registry(dict(args.package)).learn(f"{actual}_Goal", bus.definition)
    value = values.plain(text)
    goal = completed(kind, value)
    if bad := not_finite(goal):
        raise ValueError(f"refused: {bad} is not a finite number")
    return {name: goal[name] for name in value}


class Errand:
    """A goal on its way, from the command line."""

    def __init__(self, bus: Bus, args: argparse.Namespace, kind: str) -> None:
        self._bus, self._key, self._timeout, self._json = bus, args.key, args.timeout, args.json
        self._kind, self._reader = kind, Reader(packages=args.package)
        self._id = {"uuid": list(new_id())}
        self._feedback = bus.subscribe_raw(key_of(args.key, FEEDBACK)) if args.feedback else None

    def run(self, goal: Any, stop: threading.Event) -> int:
        """Send it and wait for its end; cancel it once `stop` is set. Returns the exit code."""
        try:
            reply = self._call(SEND, {"goal_id": self._id, "goal": goal})
        except NoReply:
            self._cancel()  # it may have been accepted all the same
            raise
        answer = self._value(reply, "SendGoal_Response")
        if not isinstance(answer, dict):
            self._cancel()  # it may have been accepted
            raise BusError(f"{self._key}: the reply could not be decoded: {self._reader.why}")
        if not answer.get("accepted"):
            reason = reply.attachment.decode(errors="replace") or "its server gives no reason"
            report(f"holozen action send_goal: {self._key}: the goal was rejected: {printable(reason)}")
            return 1
        identity = bytes(self._id["uuid"]).hex()
        self._print({"goal_id": identity, "accepted": True}, f"Goal accepted with ID: {identity}")
        asked = {"goal_id": self._id}
        gone = threading.Event()
        result = background(
            lambda: wait_for_result(self._bus, self._key, json.dumps(asked).encode(), JSON, gone.is_set)
        )
        try:
            return self._follow(result, stop)
        finally:
            gone.set()

    def _follow(self, result: Callable[[], Any], stop: threading.Event) -> int:
        ended = threading.Event()
        threading.Thread(target=_set_after, args=(result, ended), daemon=True).start()
        while not ended.is_set() and not stop.is_set():
            self._print_feedback()
            stop.wait(POLL)
        if not ended.is_set():
            report(f"holozen action send_goal: {self._key}: cancelling the goal")
            self._cancel()
            if not ended.wait(END):
                report(f"holozen action send_goal: {self._key}: the goal has not ended within {END:g} s; it may go on")
                return 130
        self._print_feedback()
        reply = result()
        value = self._value(reply, "GetResult_Response")
        status, outcome = (value.get("status"), value.get("result")) if isinstance(value, dict) else (0, value)
        name = State(status).name if status in list(State) else str(status)
        shown = ["Result:", *lines(outcome, "  "), f"Goal finished with status: {name}"]
        self._print({"status": name, "result": outcome}, "\n".join(shown))
        return 0 if name == State.SUCCEEDED.name else 130 if stop.is_set() else 1

    def _cancel(self) -> None:
        try:
            reply = self._value(
                self._call(CANCEL, {"goal_info": {"goal_id": self._id}}), "CancelGoal_Response", "action_msgs/srv/"
            )
        except BusError as error:
            report(f"holozen action send_goal: {error}")
            return
        if isinstance(reply, dict) and not reply.get("goals_canceling"):
            report(f"holozen action send_goal: {self._key}: its server does not cancel the goal")

    def _call(self, part: str, value: Any) -> Any:
        return call_bytes(self._bus, key_of(self._key, part), json.dumps(value).encode(), JSON, self._timeout)[0]

    def _value(self, reply: Any, ending: str, start: str = "") -> Any:
        if reply.encoding == CDR:  # whose encoding does not name the type
            reply.encoding = f"{CDR};{start or f'{self._kind}_'}{ending}"
        return self._reader.read(reply, self._bus)

    def _print_feedback(self) -> None:
        while self._feedback and (sample := self._feedback.try_recv()):
            value = self._reader.read(sample, self._bus)
            if isinstance(value, dict) and value.get("goal_id") == self._id:
                progress = value.get("feedback")
                self._print({"feedback": progress}, "\n".join(["Feedback:", *lines(progress, "  ")]))

    def _print(self, value: dict[str, Any], text: str) -> None:
        print(json.dumps(value) if self._json else text, flush=True)


def _set_after(work: Callable[[], object], done: threading.Event) -> None:
    try:
        work()
    except BusError:  # which the next call raises again
        pass
    done.set()


def _send_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key)
    add("words", nargs="*", metavar="[TYPE] GOAL", help="JSON or YAML (default: all zeros)")
    add("-f", "--feedback", action="store_true", help="print its progress")
    add_packages(parser)
    add("--timeout", type=number(0.01, 1e6, "s"), default=5.0, metavar="S",
        help="seconds to wait for the server and for its answer, not for the goal's end (default: 5)")  # fmt: skip


VERBS = by_name(
    Noun("action", "Inspect actions, and send goals.", dict.fromkeys(("list", "info", "send_goal"), "action")),
    Verb("action list", "the actions that nodes serve or use", "-t", list_arguments("action"), list_actions),
    Verb("action info", "an action's type, clients and servers", "navigate_to_pose", key_argument, info),
    Verb("action send_goal", "send a goal and wait for its result; Ctrl-C cancels the goal",
        """navigate_to_pose '{"pose": {"pose": {"position": {"x": 1.0}}}}' --feedback""", _send_arguments, send_goal),
)  # fmt: skip
