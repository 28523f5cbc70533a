"""`holozen action`: inspect actions, and send goals."""

from __future__ import annotations

import argparse
import json
import threading
import time
from collections.abc import Callable
from typing import Any

from holozen.background import background
from holozen.bus import Bus
from holozen.cli.hints import unknown
from holozen.cli.keys import print_list, print_sides, print_types
from holozen.cli.verb import (
    Noun,
    Verb,
    by_name,
    key_argument,
    list_arguments,
    open_bus,
    type_and_value,
)
from holozen.console import Failure, report, tell
from holozen.flags import add_packages, key, number
from holozen.output import SampleReader, lines
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
from holozen.transport.services import call_bytes, note_in

JSON = "application/json"
END = 10.0  # s for a cancelled goal to end
POLL = 0.02  # s between two looks for feedback


def list_actions(args: argparse.Namespace) -> int:
    """Print each action once."""
    with open_bus(args) as bus:
        ends, where = bus.endpoints(), bus.where
    return print_list(
        args, "action", ((action.key, action.type) for action in found_in(ends)), ends, where
    )


def action_type(args: argparse.Namespace) -> int:
    """Print the type of an action. Raises Failure if no node serves or uses it."""
    with open_bus(args) as bus:
        found, where = found_in(bus.endpoints()), bus.where
    types = {one.type for one in found if one.key == args.key}
    return print_types(args, types, {one.key for one in found}, where)


def info(args: argparse.Namespace) -> int:
    """Print an action's type, clients and servers. Raises Failure if it has none."""
    with open_bus(args) as bus:
        found, where = found_in(bus.endpoints()), bus.where
    mine = [one for one in found if one.key == args.key]
    if not mine:
        raise Failure(unknown(args.key, sorted({one.key for one in found}), where))
    clients, servers = (
        [one for one in mine if one.is_server == is_server] for is_server in (False, True)
    )
    sides = {"clients": ("Action clients", clients), "servers": ("Action servers", servers)}
    return print_sides(args, [one.type for one in mine], sides)


def send_goal(args: argparse.Namespace) -> int:
    """Send a goal and print its result; exit code 1 unless it succeeds. Ctrl-C cancels the goal."""
    given, text = type_and_value(args, "action", "GOAL")
    stop = stop_event()
    with open_bus(args, stop) as bus:
        try:
            server = _server(bus, args, stop)
            goal = (
                _goal(bus, args, server.type, given, "{}" if text is None else text)
                if server
                else {}
            )
        except ValueError as error:
            raise Failure(f"{args.key}: {error}") from None
        if server is None or stop.is_set():
            return 130
        return GoalRequest(bus, args, server.type).run(goal, stop)


def _server(bus: Bus, args: argparse.Namespace, stop: threading.Event) -> Found | None:
    """Wait for the server of the action; None once `stop` is set. Raises Failure if there is none
    in time.
    """
    deadline, found = time.monotonic() + args.timeout, list[Found]()
    with bus.graph() as graph:
        ends = graph.settled(bus.connected)
        while not stop.is_set():
            found = found_in(ends)
            if server := next(
                (one for one in found if one.is_server and one.key == args.key), None
            ):
                return server
            if time.monotonic() > deadline:
                near = suggest(args.key, sorted({one.key for one in found}))
                text = (
                    f"no server for {args.key} answered within {args.timeout:g} s at "
                    f"{bus.where}{near}"
                )
                raise Failure(f"{text}; `holozen action list` lists all")
            stop.wait(POLL)
            ends = graph.endpoints()
    return None


def _goal(bus: Bus, args: argparse.Namespace, actual: str, given: str, text: str) -> Any:
    """The goal that `text` describes, as plain values. Raises ValueError."""
    with deferred_interrupt():
        from holozen.cli import values
        from holozen.messages.registry import Registry

    if given and given != actual:
        raise ValueError(f"its type is {actual}, not {given}")
    return values.checked(
        text, Registry(dict(args.package)).learn(f"{actual}_Goal", bus.definition)
    )


class GoalRequest:
    """Sends one goal, and follows it to its end."""

    def __init__(self, bus: Bus, args: argparse.Namespace, kind: str) -> None:
        self._bus, self._key, self._timeout, self._json = bus, args.key, args.timeout, args.json
        self._kind, self._reader = kind, SampleReader(packages=args.package)
        self._id = {"uuid": list(new_id())}
        self._feedback = bus.subscribe_raw(key_of(args.key, FEEDBACK)) if args.feedback else None

    def run(self, goal: Any, stop: threading.Event) -> int:
        """Send the goal and wait for its end; cancel it once `stop` is set. Returns the exit
        code.
        """
        try:
            reply = self._call(SEND, {"goal_id": self._id, "goal": goal})
        except NoReply:
            self._cancel()  # it may have been accepted all the same
            raise
        answer = self._reader.read(reply, self._bus, f"{self._kind}_SendGoal_Response")
        if not isinstance(answer, dict):
            self._cancel()  # it may have been accepted
            raise BusError(f"{self._key}: the reply could not be decoded: {self._reader.why}")
        if not answer.get("accepted"):
            reason = note_in(reply) or "its server gives no reason"
            raise Failure(f"{self._key}: the goal was rejected: {reason}")
        identity = bytes(self._id["uuid"]).hex()
        self._print({"goal_id": identity, "accepted": True}, f"Goal accepted with ID: {identity}")
        gone, ended = threading.Event(), threading.Event()

        def wait() -> Any:
            try:
                asked = json.dumps({"goal_id": self._id}).encode()
                return wait_for_result(self._bus, self._key, asked, JSON, gone.is_set)
            finally:
                ended.set()

        try:
            return self._follow(background(wait), ended, stop)
        finally:
            gone.set()

    def _follow(
        self, result: Callable[[], Any], ended: threading.Event, stop: threading.Event
    ) -> int:
        while not ended.is_set() and not stop.is_set():
            self._print_feedback()
            stop.wait(POLL)
        if not ended.is_set():
            report(f"holozen action send_goal: {self._key}: cancelling the goal")
            self._cancel()
            if not ended.wait(END):
                report(
                    f"holozen action send_goal: {self._key}: the goal has not ended within "
                    f"{END:g} s; it may go on"
                )
                return 130
        self._print_feedback()
        reply = result()
        value = self._reader.read(reply, self._bus, f"{self._kind}_GetResult_Response")
        status, outcome = (
            (value.get("status"), value.get("result")) if isinstance(value, dict) else (0, value)
        )
        name = State(status).name if status in list(State) else str(status)
        shown = ["Result:", *lines(outcome, "  "), f"Goal finished with status: {name}"]
        self._print({"status": name, "result": outcome}, "\n".join(shown))
        return 0 if name == State.SUCCEEDED.name else 130 if stop.is_set() else 1

    def _cancel(self) -> None:
        try:
            reply = self._call(CANCEL, {"goal_info": {"goal_id": self._id}})
        except BusError as error:
            report(f"holozen action send_goal: {error}")
            return
        answer = self._reader.read(reply, self._bus, "action_msgs/srv/CancelGoal_Response")
        if isinstance(answer, dict) and not answer.get("goals_canceling"):
            report(f"holozen action send_goal: {self._key}: its server does not cancel the goal")

    def _call(self, part: str, value: Any) -> Any:
        return call_bytes(
            self._bus, key_of(self._key, part), json.dumps(value).encode(), JSON, self._timeout
        )[0]

    def _print_feedback(self) -> None:
        while self._feedback and (sample := self._feedback.try_recv()):
            value = self._reader.read(sample, self._bus)
            if isinstance(value, dict) and value.get("goal_id") == self._id:
                progress = value.get("feedback")
                self._print(
                    {"feedback": progress}, "\n".join(["Feedback:", *lines(progress, "  ")])
                )

    def _print(self, value: dict[str, Any], text: str) -> None:
        tell(json.dumps(value) if self._json else text)


def _send_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key)
    add("words", nargs="*", metavar="[TYPE] GOAL", help="JSON or YAML (default: all zeros)")
    add("-f", "--feedback", action="store_true", help="print its progress")
    add_packages(parser)
    add(
        "--timeout",
        type=number(0.01, 1e6, "s"),
        default=5.0,
        metavar="S",
        help="seconds to wait for the server and for its answer, not for the goal's end (default: "
        "5)",
    )


VERBS = by_name(
    Noun("action", "inspect actions, and send goals"),
    Verb(
        "action list",
        "list the actions that nodes serve or use",
        "-t",
        list_arguments("action"),
        list_actions,
    ),
    Verb("action type", "show an action's type", "navigate_to_pose", key_argument, action_type),
    Verb(
        "action info",
        "show an action's type, clients and servers",
        "navigate_to_pose",
        key_argument,
        info,
    ),
    Verb(
        "action send_goal",
        "send a goal and wait for its result; Ctrl-C cancels the goal",
        """navigate_to_pose '{"pose": {"pose": {"position": {"x": 1.0}}}}' --feedback""",
        _send_arguments,
        send_goal,
    ),
)
