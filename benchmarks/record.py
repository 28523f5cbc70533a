"""`holozen record` of 50 topics at 100 Hz: is everything in the file, and how late was it recorded?

The publisher is our bus in another process: typed Odometry with a number in each message. Messages
that are missing in the file are counted by where they were lost. Nothing else records Zenoh keys
into MCAP, so there is no comparison.
"""

import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.company import HOLOZEN, guest, host, meeting_point, until
from benchmarks.latency import ODOM
from benchmarks.report import Case, parser, publish
from holozen.bags.reader import Bag
from holozen.bus import Bus
from holozen.messages import Odometry, Time, codec

AIM = "every message that was received is in the file; what is missing is counted"
TOPICS, RATE = 50, 100.0  # Hz
# A publisher drops a message that waits for a millisecond; with more patience it is the recorder
# that is measured.
WAIT = ("transport/link/tx/queue/congestion_control/drop/wait_before_drop", "20000")  # us
SECONDS, QUICK = 60.0, 0.3


def send(bus: Bus, seconds: float) -> int:
    """Publish on all topics for `seconds`, each message numbered and stamped; how many each got."""
    publishers = [bus.publisher(f"r{index}/odom", Odometry) for index in range(TOPICS)]
    until(lambda: all(publisher.matched for publisher in publishers))
    due = time.monotonic()
    for count in range(round(seconds * RATE)):
        ODOM.child_frame_id = str(count)
        for (
            publisher
        ) in publishers:  # spread over the period, as robots are that know nothing of each other
            ODOM.header.stamp = Time(*divmod(time.time_ns(), 10**9))
            publisher.put(ODOM)
            due += 1 / RATE / TOPICS
            time.sleep(max(0.0, due - time.monotonic()))
    time.sleep(0.5)  # the last ones are on their way
    return count + 1


def record(seconds: float, folder: Path) -> tuple[int, dict[str, Any], Path, float]:
    """Record while another process publishes: messages a topic, the recorder's last line, its file
    and its CPU s.
    """
    endpoint = meeting_point()
    flags = guest(endpoint).arguments()
    words = [HOLOZEN, "record", "-a", "--json", "-o", str(folder / "bag"), *flags]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with (
        Bus("robots", host(endpoint)._replace(cfg=(WAIT,))) as bus,
        subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process,
    ):
        try:
            count = send(bus, seconds)
        finally:
            process.send_signal(signal.SIGINT)
        assert process.stdout
        *_, last = process.stdout.read().splitlines()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return count, json.loads(last), folder / "bag.mcap", cpu


def read(path: Path) -> tuple[dict[str, list[int]], list[float]]:
    """The numbers that are in the file, by topic, and how many ms each message was on its way."""
    numbers: dict[str, list[int]] = {}
    late = []
    with Bag(path) as bag:
        for message in bag.messages():
            odom = codec.decode(message.payload, message.channel.encoding, (Odometry,))
            numbers.setdefault(message.channel.key, []).append(int(odom.child_frame_id))
            stamp = odom.header.stamp
            late.append((message.at - stamp.sec * 10**9 - stamp.nanosec) / 1e6)
    return numbers, late


def main() -> int:
    args = parser("record", __doc__).parse_args()
    seconds = QUICK if args.quick else SECONDS
    with tempfile.TemporaryDirectory() as folder:
        count, last, path, cpu = record(seconds, Path(folder))
        size = path.stat().st_size
        numbers, late = read(path)
    found = sum(map(len, numbers.values()))
    reported = {
        "sent": count * TOPICS,
        "in the file": found,
        "lost before the recorder": count * TOPICS - last["messages"] - last["dropped"],
        "of these known by their numbers": last["lost"],
        "dropped by the recorder": last["dropped"],
        "lost after it was received": last["messages"] - found,
        "out of order": sum(rows != sorted(rows) for rows in numbers.values()),
        "megabytes": round(size / 1e6, 1),
        "cpu percent": round(100 * cpu / seconds, 1),
    }
    case = Case(f"{TOPICS} topics at {RATE:g} Hz, sent to taken in", "ms", AIM, {"holozen": [late]})
    publish("record", [case], args.json, counts=reported)
    for name, value in reported.items():
        print(f"{name}: {value}")
    return 0 if reported["lost after it was received"] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
