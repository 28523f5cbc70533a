"""Round trip of a command: cmd_vel (Twist) there, odom (Odometry) back, between two processes on
loopback.

Our bus, typed at both ends, against raw zenoh-python with the same bytes, the same settings and no
types; and against the same with msgspec at both ends, which leaves what the bus adds: sender,
number and time, the checks of a command.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import msgspec
import zenoh

from benchmarks.company import beside, guest, host, meeting_point, until
from benchmarks.report import Case, parser, publish
from holozen.bus import Bus
from holozen.messages import (
    Header,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Time,
    Twist,
    TwistStamped,
    TwistWithCovariance,
    codec,
)
from holozen.transport.beat import PERIOD_NS, Beat
from holozen.transport.connection import Connection
from holozen.wire import MAX_COMMAND_BYTES

AIM = "ratio <= 1.2 (ours / raw zenoh, without types)"
RATE = 50.0  # Hz, of the paced case
DEPTH = 64  # samples that a reader keeps, on both sides

# Numbers with all their digits, as a robot that moves has them.
COMMAND = Twist.planar(0.3141592653589793, -0.1234567890123456, 0.2718281828459045)
VARIANCES = [
    1e-5 if i in (0, 7) else 1e-3 if i == 35 else 1e12 if i % 7 == 0 else 0.0 for i in range(36)
]
POSE = Pose(
    Point(1.2345678901234567, -0.9876543210987654, -0.0400123456789),
    Quaternion(0, 0, 0.3826834, 0.9238795),
)
ODOM = Odometry(
    Header(Time(12, 345_678_901), "odom"),
    "footprint_link",
    PoseWithCovariance(POSE, VARIANCES),
    TwistWithCovariance(COMMAND, VARIANCES),
)
ASKED, ANSWER = codec.encode(COMMAND), codec.encode(ODOM)

Trip = Callable[[], object]
"""Sends a command and waits for the answer."""


def answer_ours(endpoint: str) -> None:
    """A robot on our bus."""
    with Bus("robot", host(endpoint)) as bus:
        commands = bus.subscribe(
            "cmd_vel", Twist, TwistStamped, depth=DEPTH, limit=MAX_COMMAND_BYTES
        )
        odom = bus.publisher("odom", Odometry)
        threading.Thread(target=beat_on, args=(bus.beat(),), daemon=True).start()
        while True:
            assert commands.recv().message == COMMAND
            odom.put(ODOM)


def beat_on(beat: Beat) -> None:
    """Beat as a robot does, which sends nothing else while it waits."""
    while True:
        beat.poll()
        time.sleep(PERIOD_NS * 1e-9)


def answer_raw(endpoint: str) -> None:
    """A robot on raw zenoh."""
    with open_raw(host(endpoint)) as session:
        commands, odom = raw_ends(session, reads="cmd_vel", writes="odom")
        while True:
            assert bytes(commands.recv().payload) == ASKED
            odom.put(ANSWER)


def answer_typed(endpoint: str) -> None:
    """A robot on raw zenoh, with msgspec."""
    encode, decode = msgspec.json.Encoder().encode, msgspec.json.Decoder(Twist).decode
    with open_raw(host(endpoint)) as session:
        commands, odom = raw_ends(session, reads="cmd_vel", writes="odom")
        while True:
            assert decode(commands.recv().payload.to_bytes()) == COMMAND
            odom.put(encode(ODOM))


@contextmanager
def ours(endpoint: str) -> Iterator[Trip]:
    """The pilot's side on our bus."""
    with Bus("pilot", guest(endpoint)) as bus:
        odom = bus.subscribe("odom", Odometry, depth=DEPTH)
        commands = bus.publisher("cmd_vel", Twist)

        def trip() -> object:
            commands.put(COMMAND)
            return odom.recv().message

        meet(lambda: commands.put(COMMAND), odom.try_recv)
        assert trip() == ODOM
        yield trip


@contextmanager
def raw(endpoint: str) -> Iterator[Trip]:
    """The pilot's side on raw zenoh."""
    with open_raw(guest(endpoint)) as session:
        odom, commands = raw_ends(session, reads="odom", writes="cmd_vel")

        def trip() -> object:
            commands.put(ASKED)
            return bytes(odom.recv().payload)

        meet(lambda: commands.put(ASKED), odom.try_recv)
        assert trip() == ANSWER
        yield trip


@contextmanager
def typed(endpoint: str) -> Iterator[Trip]:
    """The pilot's side on raw zenoh, with msgspec."""
    encode, decode = msgspec.json.Encoder().encode, msgspec.json.Decoder(Odometry).decode
    with open_raw(guest(endpoint)) as session:
        odom, commands = raw_ends(session, reads="odom", writes="cmd_vel")

        def trip() -> object:
            commands.put(encode(COMMAND))
            return decode(odom.recv().payload.to_bytes())

        meet(lambda: commands.put(ASKED), odom.try_recv)
        assert trip() == ODOM
        yield trip


def open_raw(connection: Connection) -> Any:
    """A session with the settings that ours has."""
    config = zenoh.Config()
    for path, value in connection.settings().items():
        config.insert_json5(path, value)
    return zenoh.open(config)


def raw_ends(session: Any, reads: str, writes: str) -> tuple[Any, Any]:
    """A subscriber and a publisher as our bus declares them."""
    subscriber = session.declare_subscriber(reads, zenoh.handlers.RingChannel(DEPTH))
    return subscriber, session.declare_publisher(writes, encoding="application/json", express=True)


def meet(send: Callable[[], None], try_recv: Callable[[], object]) -> None:
    """Send until an answer comes, and discard all answers."""

    def answered() -> bool:
        send()
        return try_recv() is not None

    until(answered)
    time.sleep(0.2)
    while try_recv() is not None:
        pass


def timed(trip: Trip, count: int, period: float = 0.0) -> list[float]:
    """Microseconds of each of `count` round trips, one every `period` seconds (0: the next at
    once).
    """
    times, due = [], time.perf_counter()
    for _ in range(count):
        due += period
        if (left := due - time.perf_counter()) > 0:
            time.sleep(left)
        start = time.perf_counter_ns()
        trip()
        times.append((time.perf_counter_ns() - start) / 1000)
    return times


def compare(
    name: str, aim: str, trips: dict[str, Trip], turns: int, count: int, period: float = 0.0
) -> Case:
    """One case, `turns` rounds of `count` trips a side."""
    rounds = {side: partial(timed, trip, count, period) for side, trip in trips.items()}
    return Case(name, "us", aim).take_turns(turns, **rounds)


def main() -> int:
    args = parser("latency", __doc__).parse_args()
    a, b, c = meeting_point(), meeting_point(), meeting_point()
    turns, flat, paced = (1, 100, 5) if args.quick else (40, 500, 25)
    with (
        beside(answer_ours, a),
        beside(answer_raw, b),
        beside(answer_typed, c),
        ours(a) as bus,
        raw(b) as bare,
        typed(c) as bare_typed,
    ):
        untyped = {"holozen": bus, "raw_zenoh": bare}
        with_msgspec = {"holozen": bus, "zenoh_and_msgspec": bare_typed}
        for sides in (untyped, with_msgspec):
            compare("warm up", "", sides, turns=2, count=flat)
        cases = [
            compare("flat out", AIM, untyped, turns, flat),
            compare("flat out, typed", "", with_msgspec, turns, flat),
            compare(f"paced at {RATE:g} Hz", AIM, untyped, turns, paced, 1 / RATE),
            compare(f"paced at {RATE:g} Hz, typed", "", with_msgspec, turns, paced, 1 / RATE),
        ]
    publish("latency", cases, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
