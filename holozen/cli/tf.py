"""`holozen tf`: transforms between the frames that `tf` and `tf_static` connect."""

from __future__ import annotations

import argparse
import json
import math
import re
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from holozen.bus import Bus
from holozen.cli.hints import no_nodes
from holozen.cli.verb import Noun, Verb, by_name, open_bus
from holozen.console import Failure, printable, report
from holozen.flags import number, robot
from holozen.frames import Frames
from holozen.process import stop_event
from holozen.rotation import Transform, to_rpy
from holozen.suggest import listed
from holozen.transport.graph import on_key
from holozen.transport.samples import Sample

if TYPE_CHECKING:
    from holozen.messages import TFMessage
    from holozen.transport.pubsub import Subscription

TICK = 0.01  # s between two polls
ASK = 0.3  # s to wait for replies with static transforms
WAITING = 1.0  # s without a transform until that is reported
_TF = re.compile(r"(.+/)?tf(_static)?$")


def echo(args: argparse.Namespace) -> int:
    """Print the pose of a frame in another one, until interrupted."""
    stop = stop_event()
    with open_bus(args, stop=stop) as bus:
        from holozen.messages import TFMessage  # while the session opens

        keys = [f"{args.robot}/{key}" if args.robot else key for key in ("tf", "tf_static")]
        readers = [bus.subscribe(key, TFMessage) for key in keys]
        frames = Frames()
        for message in _held(bus, keys[1]):
            frames.take(message, static=True)
        begun, due, shown, warned = time.monotonic(), 0.0, False, False
        while not stop.wait(TICK):
            for reader, static in zip(readers, (False, True), strict=True):
                _take_all(reader, frames, static)
            now = time.monotonic()
            if now < due:
                continue
            try:
                pose, stamp = frames.lookup(args.source, args.target)
            except LookupError as error:
                passed = now - begun
                if args.timeout and passed > args.timeout and not shown:
                    raise Failure(_why(bus, keys[0], frames, error)) from None
                if passed > WAITING and not (warned or args.timeout):
                    report(
                        f"waiting for {args.source} -> {args.target}; "
                        f"{_why(bus, keys[0], frames, error)}"
                    )
                    warned = True
                continue
            _print(args, pose, stamp)
            if args.once:
                return 0
            due, shown = now + 1 / args.rate, True
    return 0


def _take_all(reader: Subscription[TFMessage], frames: Frames, static: bool) -> None:
    """Take in the messages that wait."""
    while (received := reader.try_recv()) is not None:
        if received.message is not None:
            frames.take(received.message, static)


def _held(bus: Bus, key: str) -> Iterable[TFMessage]:
    """The last messages of all publishers of a key, since static transforms are sent only once."""
    from holozen.messages import TFMessage, codec

    ours = bus.last_messages(on_key(bus.endpoints(), key, "pub"))
    # also foreign ones, which announce nothing
    for answer in (*ours, *bus.ask_all(key, ASK)):
        if isinstance(answer, Sample):
            try:
                yield codec.decode(answer.payload, answer.encoding, (TFMessage,), tolerant=True)
            except codec.CodecError:
                continue


def _why(bus: Bus, key: str, frames: Frames, error: LookupError) -> str:
    if not bus.connected():
        return f"no transforms on {key}; {no_nodes(bus.where)}"
    others = {
        end.key.rpartition("/")[0]
        for end in bus.endpoints()
        if end.kind == "pub" and _TF.match(end.key)
    }
    flags = ["without --robot"] if "" in others and key != "tf" else []
    if named := others - {"", key.rpartition("/")[0]}:
        flags.append(f"with --robot {listed(named)}")
    hint = (
        f"; there are {'others' if frames.names() else 'some'} {' and '.join(flags)}"
        if flags
        else ""
    )
    return f"{error if frames.names() else f'no transforms on {key}'}{hint}"


def _print(args: argparse.Namespace, pose: Transform, stamp: float) -> None:
    rpy = to_rpy(pose.rotation)
    if args.json:
        row = {"time": stamp, "source": args.source, "target": args.target}
        row |= {"translation": pose.translation, "rotation": pose.rotation, "rpy": rpy}
        print(json.dumps(row), flush=True)
        return
    print(
        f"At time {stamp:.3f}\n"
        f"- Translation: {_listed(pose.translation)}\n"
        f"- Rotation: in Quaternion (xyzw) {_listed(pose.rotation)}\n"
        f"- Rotation: in RPY (radian) {_listed(rpy)}\n"
        f"- Rotation: in RPY (degree) {_listed(map(math.degrees, rpy))}",
        flush=True,
    )


def _listed(values: Iterable[float]) -> str:
    return (
        f"[{', '.join(f'{round(value, 3) + 0.0:.3f}' for value in values)}]"  # + 0.0: never -0.000
    )


def _frame(text: str) -> str:
    return printable(text.removeprefix("/"))


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "source",
        type=_frame,
        metavar="SOURCE",
        help="the frame in which the pose is given, such as odom",
    )
    add(
        "target",
        type=_frame,
        metavar="TARGET",
        help="the frame whose pose it is, such as base_link",
    )
    add(
        "--robot",
        type=robot,
        default="",
        metavar="NAME",
        help="the robot whose keys to use (default: those at the root)",
    )
    add(
        "-r",
        "--rate",
        type=number(0.01, 100, "Hz"),
        default=1.0,
        metavar="HZ",
        help="poses per second (default: 1)",
    )
    add("-1", "--once", action="store_true", help="end after the first one")
    add(
        "--timeout",
        type=number(0.01, 1e6, "s"),
        metavar="S",
        help="exit code 1 after S seconds without one",
    )


VERBS = by_name(
    Noun("tf", "inspect the transforms between frames"),
    Verb("tf echo", "print the pose of a frame in another one", "odom base_link", _arguments, echo),
)
