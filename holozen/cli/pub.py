"""`holozen topic pub`: write checked messages to a key."""

import argparse
import json
import sys
import threading
import time
from typing import Any

from holozen import codec, connection, wire
from holozen.bus import Bus, Publisher
from holozen.graph import on_key
from holozen.messages import Message, Twist, TwistStamped
from holozen.process import stop_event
from holozen.tell import say

LARGEST = 1_000_000  # bytes of a value
STOPS, STOP_EVERY = 5, 0.02  # s
PATIENCE = 3.0  # s until somebody has to subscribe


def pub(args: argparse.Namespace) -> int:
    """Publish a value once, some times, or until interrupted; a robot that it moved is stopped at the end."""
    row = wire.topic(args.key)
    if set(args.key) & set("*$?#"):
        say(f"holozen topic pub: {args.key!r}: write to one key; a wildcard would move every robot")
        return 1
    row = row or _row_of_listener(args)
    if row is None:
        known = ", ".join(topic.key for topic in wire.TOPICS)
        say(f"holozen topic pub: {args.key!r} has no known type; known keys: {known}, each also as ROBOT/key")
        return 1
    try:
        message = read_message(args.value, row.types)
    except ValueError as error:
        say(f"holozen topic pub {args.key}: refused: {error}")
        return 1
    stop = stop_event()
    with Bus("topic_pub", connection.from_arguments(args), patience=PATIENCE) as bus:
        publisher: Publisher[Message] = bus.publisher(args.key, type(message))
        if not _matched(publisher, stop):
            say(f"nobody subscribes to {args.key}")
            if args.once:
                return 1
        try:
            _publish(publisher, message, args, row.rate, stop)
        finally:
            if isinstance(message, Twist | TwistStamped) and not args.once:
                _stop_robot(publisher, message)
    return 0


def _row_of_listener(args: argparse.Namespace) -> wire.Topic | None:
    """The row of the type that somebody reads on the key: a robot's file may call its topics anything."""
    with Bus("topic_pub", connection.from_arguments(args), patience=PATIENCE) as bus:
        wanted = {endpoint.type for endpoint in on_key(bus.graph().settled(bus.connected), args.key, "sub")}
    return next((row for row in wire.TOPICS if {kind.ROS for kind in row.types} & wanted), None)


def read_message(text: str, kinds: tuple[type[Message], ...]) -> Message:
    """The message that `text` (JSON or YAML, or - for standard input) describes. Raises ValueError with the reason."""
    if text == "-":
        text = sys.stdin.read(LARGEST + 1)
    if len(text) > LARGEST:
        raise ValueError(f"the value is longer than {LARGEST} bytes")
    message = codec.convert(_plain(text), kinds)
    codec.encode(message)  # what cannot be sent is told now
    return message


def _plain(text: str) -> Any:
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("the value is nested too deeply") from None
    except ValueError as error:
        return _yaml(text, error)


def _yaml(text: str, why_no_json: ValueError) -> Any:
    try:
        import yaml
    except ModuleNotFoundError:
        raise ValueError(f"no JSON: {why_no_json}; to write YAML: pip install pyyaml") from None
    try:
        return yaml.safe_load(text)
    except RecursionError:
        raise ValueError("the value is nested too deeply") from None
    except yaml.YAMLError as error:
        raise ValueError(f"neither JSON nor YAML: {' '.join(str(error).split())}") from None


def _matched(publisher: Publisher[Message], stop: threading.Event) -> bool:
    deadline = time.monotonic() + PATIENCE
    while not publisher.matched:
        if time.monotonic() > deadline or stop.wait(0.005):
            return False
    return True


def _publish(
    publisher: Publisher[Message], message: Message, args: argparse.Namespace, rate: float, stop: threading.Event
) -> None:
    left = 1 if args.once else args.times
    due = time.monotonic()
    while not stop.is_set() and left != 0:
        publisher.put(message)
        left = left and left - 1
        due += 1 / (args.rate or rate)
        if not args.once:  # the last one counts for a period too
            stop.wait(max(0.0, due - time.monotonic()))


def _stop_robot(publisher: Publisher[Message], message: Message) -> None:
    """Send stops, more than one: a congested link drops some."""
    for _ in range(STOPS):
        publisher.put(type(message)())
        time.sleep(STOP_EVERY)
