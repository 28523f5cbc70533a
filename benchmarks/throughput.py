"""Odometry from one process to another as fast as possible: our bus, typed at both ends, against
raw zenoh-python with the same bytes, and msgspec at both ends.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgspec
import zenoh

from benchmarks.company import beside, guest, host, meeting_point, until
from benchmarks.latency import ODOM, open_raw
from benchmarks.report import Case, parser, publish
from holozen.bus import Bus
from holozen.messages import Odometry

AIM = "ratio <= 1.25 (ours / raw zenoh with msgspec): 0.8 of its throughput"
DEPTH = 1024  # samples that a reader keeps, on both sides

Recv = Callable[[], object]
"""Waits for the next message."""


def send_ours(endpoint: str) -> None:
    """A robot on our bus."""
    with Bus("robot", host(endpoint)) as bus:
        odom = bus.publisher("odom", Odometry, block=True)
        until(lambda: odom.matched)
        while True:
            odom.put(ODOM)


def send_raw(endpoint: str) -> None:
    """A robot on raw zenoh."""
    encode = msgspec.json.Encoder().encode
    with open_raw(host(endpoint)) as session:
        odom = session.declare_publisher(
            "odom", encoding="application/json", congestion_control=zenoh.CongestionControl.BLOCK
        )
        until(lambda: odom.matching_status.matching)
        while True:
            odom.put(encode(ODOM))


@contextmanager
def ours(endpoint: str) -> Iterator[Recv]:
    """The reader on our bus."""
    with beside(send_ours, endpoint), Bus("reader", guest(endpoint)) as bus:
        odom = bus.subscribe("odom", Odometry, depth=DEPTH)
        assert odom.recv().message == ODOM
        yield lambda: odom.recv().message


@contextmanager
def raw(endpoint: str) -> Iterator[Recv]:
    """The reader on raw zenoh."""
    decode: Any = msgspec.json.Decoder(Odometry).decode
    with beside(send_raw, endpoint), open_raw(guest(endpoint)) as session:
        odom = session.declare_subscriber("odom", zenoh.handlers.RingChannel(DEPTH))
        assert decode(bytes(odom.recv().payload)) == ODOM
        yield lambda: decode(bytes(odom.recv().payload))


def timed(side: Callable[[str], Any], seconds: float) -> list[float]:
    """Microseconds for each message, over some seconds. Each side takes both cores, so they never
    run together.
    """
    with side(meeting_point()) as recv:
        count, start = 0, time.perf_counter()
        while (passed := time.perf_counter() - start) < seconds:
            for _ in range(100):
                recv()
            count += 100
    return [passed / count * 1e6]


def main() -> int:
    args = parser("throughput", __doc__).parse_args()
    turns, seconds = (1, 0.2) if args.quick else (15, 1.0)
    case = Case("typed Odometry", "us", AIM).take_turns(
        turns, holozen=lambda: timed(ours, seconds), raw_zenoh=lambda: timed(raw, seconds)
    )
    publish("throughput", [case], args.json)
    for side, figures in case.sides().items():
        print(f"{side}: {1e6 / figures['p50']:,.0f} messages a second")
    return 0


if __name__ == "__main__":
    sys.exit(main())
